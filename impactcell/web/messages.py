"""Texts in the language of who reads them, numbers as that language writes them."""

import math
from collections.abc import Mapping
from typing import Any

from impactcell.alarms import RULES, Message
from impactcell.alarms.rule import percent_sure
from impactcell.german.findings import (
    ENGLISH_STEPS,
    GERMAN_QUANTITIES,
    GERMAN_STEPS,
    german_effect,
    german_headline,
    german_texts,
)
from impactcell.german.link_faults import german_link_fault
from impactcell.german.parameters import parameter_words
from impactcell.physics.effect_names import as_title, in_words
from impactcell.physics.effects import LIBRARY
from impactcell.records import Alarm
from impactcell.records.uncertainty import TOLD_STDS
from impactcell.web.texts import CATALOGUE, LANGUAGES
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note
from impactcell.web.texts.model_faults import model_fault
from impactcell.web.texts.model_origins import model_caution
from impactcell.web.texts.reasons import english_reason, german_reason

LEAST_WHOLE = 9.95
"""From here on two significant digits are a whole number."""
ADDED = " + "
"""Between the name of a model and the effects that were added to it."""
UNSURE_DIGITS = 5
"""Significant digits of a value beside which no standard deviation is known."""
LARGE = 1e9
"""From here on a number is written with an exponent, in any unit."""


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


def _told_decimals(std: float) -> int | None:
    """Count the decimals that two significant digits of what is told of a standard deviation need.

    None where it is not finite, and so nothing is told of it.
    """
    told = TOLD_STDS * std
    return max(1 - int(f"{told:.1e}".partition("e")[2]), 0) if math.isfinite(told) else None


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
        """Say why an alarm came, or had come; of one that has not come, why it is watched or not."""
        if not alarm.message:
            return self["suppressed_why" if alarm.suppressed else "watched_again"] if alarm.enabled else ""
        message = Message(alarm.message, alarm.message_de or alarm.message).text(self.language)
        return message if alarm.active else f"{self['it_said']} {message}"

    def compared(self, alarm: Alarm) -> str:
        """Say what an alarm compared with what, a probability in per cent; empty for one without figures."""
        evidence, is_probability = alarm.evidence, RULES[alarm.name].is_probability
        if math.isnan(evidence.statistic):
            return ""
        if is_probability:
            statistic = f"{percent_sure(evidence.statistic)[self._index]} %"
            threshold = f"{self.number(100.0 * evidence.threshold, 5)} %"
        else:
            statistic, threshold = self.number(evidence.statistic, 3), self.number(evidence.threshold, 3)
        said = f"{self['probability' if is_probability else 'statistic']} {statistic}"
        return said if math.isnan(evidence.threshold) else f"{said}, {self['threshold']} {threshold}"

    def published_reason(self, reason: str) -> str:
        """Say why a value is uncertain or missing."""
        return german_reason(reason) if self.language == "de" else english_reason(reason)

    def link_fault(self, reason: str) -> str:
        """Say why a module does not answer."""
        return german_link_fault(reason) if self.language == "de" else reason

    def refusal(self, code: str) -> str:
        """Say why something was not done, by OPC UA's name of it; what an address makes up is not repeated.

        >>> Messages("en").refusal("BadConditionAlreadyShelved")
        'somebody has shelved it already'
        """
        key = f"refused_{code}"
        return self[key if key in CATALOGUE else "refused_other"]

    def headline(self, result: Mapping[str, Any]) -> str:
        """Say what a study found."""
        return german_headline(result) if self.language == "de" else str(result["headline"])

    def effect(self, identifier: str) -> str:
        """Name an effect."""
        return german_effect(identifier) if self.language == "de" else in_words(identifier)

    def model(self, name: str) -> str:
        """Name a model: what has been added to it in words.

        >>> Messages("de").model("prototype + viscous_friction")
        'prototype + Viskose Reibung'
        """
        base, *added = name.split(ADDED)
        return ADDED.join([base, *(self.effect(part) if part in LIBRARY else part for part in added)])

    def parameter(self, effect: str, name: str) -> tuple[str, str]:
        """Give words and unit of an effect's parameter."""
        return parameter_words(effect, name, self.language)

    def changed_parameter(self, name: str) -> str:
        """Name a parameter of a model, after its effect where it has one, with its unit.

        >>> Messages("de").changed_parameter("stribeck_friction.stribeck_velocity_m_s")
        'Stribeck-Reibung: Stribeck-Geschwindigkeit [m/s]'
        """
        effect, _, own = name.rpartition(".")
        words, unit = self.parameter(effect, own)
        said = f"{as_title(self.effect(effect))}: {words}" if effect else words
        return f"{said} [{unit}]" if unit else said

    def advice(self, effect: Mapping[str, Any]) -> tuple[str, str]:
        """Say what an effect of a result means and what to look at; empty where that is not known."""
        if self.language == "de" and (german := german_texts(effect["effect"])) is not None:
            return german.meaning, german.look_at
        return effect.get("meaning", ""), effect.get("look_at", "")

    def quantity(self, name: str) -> str:
        """Name what a column means."""
        return GERMAN_QUANTITIES.get(name, name) if self.language == "de" else name

    def note(self, note: str) -> tuple[str, str]:
        """Say what was noted of dropped files, after the language in which it is said."""
        return page_note(note, self.language)

    def fault(self, fault: str) -> tuple[str, str]:
        """Say why files cannot be read or a model is refused, after the language in which it is said."""
        refusal = model_fault(fault, self.language, self.model)
        return page_fault(fault, self.language) if refusal is None else (self.language, refusal)

    def verdict(self, verdict: str | None) -> str:
        """Say what an investigation established by its verdict; empty for one that is not known."""
        key = f"verdict_{verdict}"
        return self[key] if key in CATALOGUE else ""

    def caution(self, caution: str) -> tuple[str, str]:
        """Say why a model is to be taken with caution, after the language in which it is said."""
        return model_caution(caution, self.language)

    def step(self, name: str) -> str:
        """Name a step of a study."""
        return (GERMAN_STEPS if self.language == "de" else ENGLISH_STEPS).get(name, name)

    def number(self, value: float, digits: int) -> str:
        """Write a number with so many significant digits, and an exponent only where it is large or small.

        >>> Messages("de").number(0.1234, 2), Messages("en").number(649980.0, 5)
        ('0,12', '649980')
        """
        text = f"{value:.{digits}g}"
        if "e+" in text and abs(value) < LARGE:
            text = f"{float(text):.0f}"
        return text.replace(".", ",") if self.language == "de" else text

    def written(self, quantity: str) -> str:
        """Write a quantity that has a decimal point as this language writes it.

        >>> Messages("de").written("18.9 kg")
        '18,9 kg'
        """
        return quantity.replace(".", ",") if self.language == "de" else quantity

    def understood(self, quantity: str) -> str:
        """Read a quantity as this language writes it; a comma that is no decimal mark stays, and is refused.

        >>> Messages("de").understood("18,9 kg"), Messages("en").understood("18,900 kg")
        ('18.9 kg', '18,900 kg')
        """
        is_decimal = self.language == "de" and quantity.count(",") == 1 and "." not in quantity
        return quantity.replace(",", ".") if is_decimal else quantity

    def size(self, length: int) -> str:
        """Write the length of a file.

        >>> [Messages("de").size(length) for length in (12, 4321, 999_999, 1_250_000)]
        ['12 B', '4,3 kB', '1 MB', '1,2 MB']
        """
        if length < 1000:
            return f"{length} B"
        in_kb = float(f"{length / 1e3:.2g}")
        return f"{self.number(in_kb, 2)} kB" if in_kb < 1000.0 else f"{self.number(length / 1e6, 2)} MB"

    def told_std(self, std: float) -> str:
        """Write what stands behind a "±", to two significant digits, also where the second is a 0.

        >>> Messages("en").told_std(0.001)
        '0.0020'
        """
        told, decimals = TOLD_STDS * std, _told_decimals(std)
        if decimals is None:
            return "–"
        text = f"{told:.{decimals}f}" if told < LEAST_WHOLE else self.number(told, 2)
        return text.replace(".", ",") if self.language == "de" else text

    def beside_std(self, value: float, std: float) -> str:
        """Write a value with as many decimals as stand behind its "±", if that is known.

        >>> Messages("de").beside_std(0.56, 0.00055)
        '0,5600'
        """
        decimals = _told_decimals(std)
        text = self.number(value, UNSURE_DIGITS) if decimals is None else f"{value:.{decimals}f}"
        return text.replace(".", ",") if self.language == "de" else text

    def for_script(self) -> dict[str, str]:
        """Give the texts that the script writes, by their key without `live_`."""
        texts = {key[5:]: texts[self._index] for key, texts in CATALOGUE.items() if key.startswith("live_")}
        return texts | {name: self.title(name) for name in RULES}
