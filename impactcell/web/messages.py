"""Every text of the page, in every language that it speaks: one catalogue."""

from collections.abc import Mapping
from typing import Final

from impactcell.alarms import RULES, Message
from impactcell.records import Alarm

LANGUAGES: Final[Mapping[str, str]] = {"en": "English", "de": "Deutsch"}
"""Languages by their code, each by its own name; the first is taken where nothing else is asked for."""

CATALOGUE: Final[Mapping[str, tuple[str, str]]] = {
    # navigation and frame
    "cells": ("Cells", "Zellen"),
    "alarms": ("Alarms", "Alarme"),
    "system": ("System", "System"),
    "skip": ("Skip to content", "Zum Inhalt springen"),
    "main_navigation": ("Main navigation", "Hauptnavigation"),
    "language": ("Language", "Sprache"),
    "theme": ("Colours", "Farben"),
    "theme_auto": ("as the system", "wie das System"),
    "theme_light": ("light", "hell"),
    "theme_dark": ("dark", "dunkel"),
    "log_out": ("Log out", "Abmelden"),
    "observer": ("observer", "Beobachter"),
    "operator": ("operator", "Bediener"),
    "engineer": ("engineer", "Ingenieur"),
    "needs_script": ("This page needs JavaScript.", "Diese Seite braucht JavaScript."),
    # login
    "log_in": ("Log in", "Anmelden"),
    "user": ("User", "Benutzer"),
    "password": ("Password", "Passwort"),
    "wrong_password": ("User or password is wrong.", "Benutzer oder Passwort ist falsch."),
    "session_over": (
        "The session is over. Please log in again.",
        "Die Sitzung ist zu Ende. Bitte neu anmelden.",
    ),
    "login_hint": ("Users are those of OPC UA.", "Benutzer sind die von OPC UA."),
    # errors
    "error": ("That did not work", "Das ging nicht"),
    "error_not_found": ("There is nothing here.", "Hier ist nichts."),
    "error_role": ("Your role does not allow this.", "Ihre Rolle erlaubt das nicht."),
    "error_foreign": ("This request came from another page.", "Diese Anfrage kam von einer anderen Seite."),
    "error_form": ("This form cannot be read.", "Dieses Formular ist nicht lesbar."),
    "error_too_long": ("This form is too long.", "Dieses Formular ist zu lang."),
    "error_token": (
        "This form belongs to another session; go back and load the page again.",
        "Dieses Formular gehört zu einer anderen Sitzung; bitte zurückgehen und neu laden.",
    ),
    "back": ("To the cells", "Zu den Zellen"),
    "refused": ("Not carried out", "Nicht ausgeführt"),
    # a card, and the groups of published values
    "static_friction": ("Static friction µs", "Haftreibung µs"),
    "wear": ("Wear", "Verschleiß"),
    "cycles_left": ("Cycles left", "Zyklen übrig"),
    "batch": ("Batch", "Charge"),
    "cycle": ("Cycle", "Zyklus"),
    "velocity": ("Tap velocity", "Stoßgeschwindigkeit"),
    "mass": ("Mass", "Masse"),
    "estimator": ("Estimated from", "Geschätzt aus"),
    "folder_Friction": ("Friction of the last cycle", "Reibung des letzten Zyklus"),
    "folder_Wear": ("Wear, followed over all cycles", "Verschleiß, über alle Zyklen verfolgt"),
    "folder_Batch": ("Batch of material", "Werkstoffcharge"),
    "folder_Signature": ("Comparison with the learned cycles", "Vergleich mit den gelernten Zyklen"),
    "beside": ("How it was measured", "Wie gemessen wurde"),
    "gap_help": (
        "Misfit of model and measurement; 1 is what the noise of the sensors alone makes.",
        "Abweichung zwischen Modell und Messung; 1 ist, was das Rauschen der Sensoren allein ausmacht.",
    ),
    # a cell's page
    "last_tap": ("Last tap", "Letzter Stoß"),
    "last_tap_help": (
        "The line is the last tap, the band what earlier taps of the same velocity did.",
        "Die Linie ist der letzte Stoß, das Band zeigt frühere Stöße gleicher Geschwindigkeit.",
    ),
    "force": ("Contact force", "Kontaktkraft"),
    "position": ("Position", "Position"),
    "trend": ("Trend", "Verlauf"),
    "trend_help": (
        "Band: range of µs of the cycles; line: tracked level; dashed: wear limit; marks: batches.",
        "Band: Bereich von µs der Zyklen; Linie: Niveau; gestrichelt: Verschleißgrenze; Marken: Chargen.",
    ),
    "span": ("Span", "Zeitraum"),
    "span_hour": ("Hour", "Stunde"),
    "span_shift": ("Shift (8 h)", "Schicht (8 h)"),
    "span_month": ("Month", "Monat"),
    "signature": ("Friction along the stroke", "Reibung entlang des Wegs"),
    "signature_help": (
        "Line: last cycle with ±2 standard deviations; band: cycles before; dashed: the last deviant cycle.",
        "Linie: letzter Zyklus mit ±2 Standardabweichungen; Band: davor; gestrichelt: letzter abweichender.",
    ),
    "positioning": ("Positioning", "Positionieren"),
    "remaining": ("Remaining", "Rest"),
    "figures": ("Figures of the last cycle", "Werte des letzten Zyklus"),
    "model_and_gap": ("Model and gap", "Modell und Abweichung"),
    # alarms
    "open_alarms": ("Open alarms", "Offene Alarme"),
    "no_open_alarms": ("No alarm needs a look.", "Kein Alarm wartet."),
    "history": ("History", "Verlauf"),
    "no_history": ("Nothing has happened yet.", "Noch ist nichts geschehen."),
    "time": ("Time", "Zeit"),
    "cell": ("Cell", "Zelle"),
    "alarm": ("Alarm", "Alarm"),
    "state": ("State", "Zustand"),
    "reason": ("Reason", "Grund"),
    "evidence": ("Evidence", "Nachweis"),
    "by": ("by", "von"),
    "comment": ("Comment", "Kommentar"),
    "save_comment": ("Comment", "Kommentieren"),
    "acknowledge": ("Acknowledge", "Quittieren"),
    "confirm": ("Confirm", "Bestätigen"),
    "shelve": ("Shelve", "Zurückstellen"),
    "unshelve": ("Unshelve", "Wieder anzeigen"),
    "minutes": ("Minutes", "Minuten"),
    "all_cells": ("All cells", "Alle Zellen"),
    "show": ("Show", "Zeigen"),
    "active": ("active", "aktiv"),
    "inactive": ("over", "vorbei"),
    "unacknowledged": ("not acknowledged", "nicht quittiert"),
    "acknowledged": ("acknowledged", "quittiert"),
    "unconfirmed": ("to be confirmed", "zu bestätigen"),
    "shelved": ("shelved", "zurückgestellt"),
    "disabled": ("disabled", "abgeschaltet"),
    "statistic": ("Statistic", "Prüfgröße"),
    "threshold": ("threshold", "Schwelle"),
    "size": ("size", "Größe"),
    "since_cycle": ("since cycle", "seit Zyklus"),
    "severity": ("severity", "Schwere"),
    "alarms_changed": ("The alarms have changed: show them", "Die Alarme haben sich geändert: anzeigen"),
    # system
    "module": ("Module", "Modul"),
    "address": ("Address", "Adresse"),
    "received": ("Cycles received", "Zyklen empfangen"),
    "missed": ("missed", "verpasst"),
    "unreadable": ("unreadable", "unlesbar"),
    "round_trip": ("Round trip", "Antwortzeit"),
    "reconnects": ("Reconnections", "Neuverbindungen"),
    "restarts": ("Module restarts", "Neustarts des Moduls"),
    "journal": ("Journal", "Journal"),
    "no_journal": ("none: nothing is kept over a restart", "keins: ein Neustart vergisst alles"),
    "journal_ok": ("is written", "wird geschrieben"),
    "opc_ua": ("OPC UA", "OPC UA"),
    "users": ("Users", "Benutzer"),
    "role": ("Role", "Rolle"),
    "certificate": ("Certificate", "Zertifikat"),
    "way_in": ("Logs in by", "Anmeldung mit"),
    "certificates": ("Certificates to trust", "Zertifikate ohne Vertrauen"),
    "certificates_help": (
        "Clients that tried to connect. Compare the thumbprint with the client's own before you trust it.",
        "Clients, die sich verbinden wollten. Vor dem Vertrauen den Fingerabdruck vergleichen.",
    ),
    "no_certificates": ("None waits.", "Keines wartet."),
    "valid_until": ("valid until", "gültig bis"),
    "trust": ("Trust", "Vertrauen"),
    "engineers_only": (
        "Users and certificates are shown to engineers.",
        "Benutzer und Zertifikate sehen Ingenieure.",
    ),
    "viewers": ("Open pages", "Offene Seiten"),
    "version": ("Version", "Version"),
    # what the script writes
    "live_live": ("live", "live"),
    "live_stale": ("no new cycle", "kein neuer Zyklus"),
    "live_lost": ("no connection to the module", "keine Verbindung zum Modul"),
    "live_waiting": ("waiting for the first cycle", "wartet auf den ersten Zyklus"),
    "live_offline": ("no connection to the service", "keine Verbindung zum Dienst"),
    "live_good": ("good", "gut"),
    "live_bad": ("not usable", "nicht verwendbar"),
    "live_passed": ("limit passed", "Grenze überschritten"),
    "live_usual": ("usual", "üblich"),
    "live_limit": ("limit", "Grenze"),
    "live_level": ("level", "Niveau"),
    "live_cycle": ("cycle", "Zyklus"),
    "live_deviates": ("deviates here", "weicht hier ab"),
    "live_force": ("the peak force", "der Spitzenkraft"),
    "live_distance": ("the sliding distance", "dem Gleitweg"),
    "live_none": ("nothing usable", "nichts Brauchbarem"),
    "live_from": ("from", "von"),
    "live_to": ("to", "bis"),
    "live_acknowledge": ("not acknowledged", "nicht quittiert"),
    "live_statistic": ("statistic", "Prüfgröße"),
    "live_threshold": ("threshold", "Schwelle"),
    "live_since_cycle": ("since cycle", "seit Zyklus"),
    "live_size": ("size", "Größe"),
    "live_time": ("time", "Zeit"),
    "live_last_alarm": ("Last alarm", "Letzter Alarm"),
    "live_uncertain": ("uncertain", "unsicher"),
    "live_not_reached": ("limit is not being approached", "Grenze wird nicht angelaufen"),
    "live_yes": ("yes", "ja"),
    "live_no": ("no", "nein"),
    "live_no_alarm": ("none", "keiner"),
    "live_open_one": ("open alarm", "offener Alarm"),
    "live_open_many": ("open alarms", "offene Alarme"),
    "live_no_task": ("no task runs", "keine Aufgabe läuft"),
    "live_no_trend": ("no cycles in this time", "keine Zyklen in dieser Zeit"),
    "live_no_past": ("this cell keeps no journal", "diese Zelle führt kein Journal"),
    "live_not_recorded": ("not recorded in this cycle", "in diesem Zyklus nicht aufgezeichnet"),
    "live_compared_with": ("compared with earlier taps:", "verglichen mit früheren Stößen:"),
    "live_waveform": ("the whole waveform", "dem ganzen Verlauf"),
    "live_combined": ("force and distance together", "Kraft und Gleitweg zusammen"),
    "live_distance_axis": ("distance slid", "Gleitweg"),
    "live_at_noise": ("at the noise of the sensors: the model explains the measurement",
                      "am Rauschen der Sensoren: das Modell erklärt die Messung"),
    "live_above_noise": ("above the noise of the sensors: something is not in the model",
                         "über dem Rauschen der Sensoren: etwas fehlt im Modell"),
}  # fmt: skip
"""Texts in the order of `LANGUAGES`. Those that begin with `live_` are for the script."""


def preferred_language(asked: str | None, remembered: str | None, accepted: str) -> str:
    """Choose a language: the one asked for, the remembered one, the browser's first that is spoken.

    >>> preferred_language(None, None, "fr;q=0.9, de-AT, en;q=0.8")
    'de'
    >>> preferred_language("en", "de", "")
    'en'
    """
    for code in (asked, remembered):
        if code in LANGUAGES:
            return str(code)
    for entry in sorted(accepted.split(","), key=_weight, reverse=True):
        code = entry.partition(";")[0].strip().lower().partition("-")[0]
        if code in LANGUAGES:
            return code
    return next(iter(LANGUAGES))


def _weight(entry: str) -> float:
    try:
        return float(entry.partition("q=")[2] or 1.0)
    except ValueError:
        return 0.0


class Messages:
    """The texts of one language: `messages["alarms"]`; those of the alarms are their rules' own."""

    def __init__(self, language: str) -> None:
        self.language = language
        self._index = list(LANGUAGES).index(language)

    def __getitem__(self, key: str) -> str:
        """Give a text."""
        return CATALOGUE[key][self._index]

    def title(self, alarm: str) -> str:
        """Name an alarm."""
        return RULES[alarm].title.text(self.language)

    def reason(self, alarm: Alarm) -> str:
        """Say why an alarm came."""
        return Message(alarm.message, alarm.message_de or alarm.message).text(self.language)

    def number(self, value: float, digits: int) -> str:
        """Write a number with so many significant digits.

        >>> Messages("de").number(0.1234, 2)
        '0,12'
        """
        text = f"{value:.{digits}g}"
        return text.replace(".", ",") if self.language == "de" else text

    def for_script(self) -> dict[str, str]:
        """Give the texts that the script writes, by their key without `live_`."""
        texts = {key[5:]: texts[self._index] for key, texts in CATALOGUE.items() if key.startswith("live_")}
        return texts | {name: self.title(name) for name in RULES}
