"""The library's effects in German: name, what it means, what to look at on the machine."""

from typing import Final

GERMAN_EFFECTS: Final[dict[str, tuple[str, str, str]]] = {
    "actuator_droop": (
        "Geschwindigkeitseinbruch des Antriebs",
        "Unter Last wird der Antrieb langsamer; seine Geschwindigkeit hat er erst nach einem Moment wieder.",
        (
            "den Antrieb: Stromgrenze, Verstärkung des Geschwindigkeitsreglers, rutschender Riemen, "
            "zu wenig Luft- oder Öldruck"
        ),
    ),
    "actuator_ramp": (
        "Anlauf des Antriebs",
        "Der Antrieb hat seine Geschwindigkeit noch nicht erreicht, wenn er das Teil trifft.",
        (
            "die Beschleunigungsgrenze des Antriebs und den freien Weg vor der Berührung: weiter entfernt "
            "beginnen oder schneller beschleunigen"
        ),
    ),
    "adhesion": (
        "Haften beim Trennen",
        "Ein Film aus Öl oder Kleber hält Teil und Stößel beim Trennen einen Moment zusammen.",
        (
            "die Flächen, die sich berühren: Öl, Kühlmittel, Kleber, weiche Auflage; reinigen, einige Stöße "
            "wiederholen"
        ),
    ),
    "batch_shift": (
        "Chargenunterschied",
        "Eine Werkstoffcharge hat mehr Reibung als eine andere.",
        "was die Chargen unterscheidet: Beschichtung, Öl, Oberfläche, Lieferant, Lagerung",
    ),
    "channel_skew": (
        "Zeitversatz der Kanäle",
        "Kraft und Position werden nicht gleichzeitig aufgezeichnet: ein Kanal kommt später.",
        "Filter und Wandler beider Kanäle und den Trigger: beide ein scharfes Ereignis aufzeichnen lassen",
    ),
    "direction_asymmetry": (
        "Richtungsabhängigkeit",
        "Das Teil gleitet in einer Richtung leichter als in der anderen.",
        "die Richtung der Bearbeitungsspuren, Grate am Teil, einseitig ziehende Schläuche oder Kabel",
    ),
    "force_saturation": (
        "Sättigung des Kraftsignals",
        "Das Kraftsignal ist oben abgeschnitten: über einer Grenze zeigt der Sensor nicht mehr.",
        "den Messbereich von Kraftsensor, Verstärker und Wandler; er muss deutlich über der Spitze enden",
    ),
    "force_sensor_gain": (
        "Verstärkungsfehler des Kraftsensors",
        "Der Kraftsensor zeigt jede Kraft um denselben Anteil zu groß oder zu klein.",
        "die Kalibrierung des Kraftsensors: mit bekanntem Gewicht belasten, eingetragenen Faktor prüfen",
    ),
    "force_sensor_lag": (
        "Trägheit des Kraftsensors",
        "Das Kraftsignal folgt der Kraft verspätet und verrundet, wie durch ein Filter.",
        "das Tiefpassfilter des Kraftverstärkers: für einen Stoß von Millisekunden vielleicht zu tief",
    ),
    "force_sensor_offset": (
        "Nullpunktfehler des Kraftsensors",
        "Der Kraftsensor zeigt nicht null, wenn ihn nichts berührt.",
        "den Nullpunkt des Kraftsensors: unbelastet tarieren; Vorspannung, Temperaturdrift, ziehendes Kabel",
    ),
    "friction_drift": (
        "Reibungsdrift",
        "Die Reibung ändert sich langsam vom ersten bis zum letzten Stoß.",
        "was sich über die Messung ändert: Verschleiß, Einlaufen, Temperatur, Schmutz, verbrauchtes Öl",
    ),
    "friction_patch": (
        "Stelle anderer Reibung",
        "An einer Stelle des Tisches ist die Oberfläche rauer oder glatter als sonst.",
        "den Tisch an der genannten Stelle: Kratzer, verschlissener oder schmutziger Fleck, Plattenstoß",
    ),
    "hertz_contact": (
        "Hertzscher Kontakt",
        "Der Kontakt wird steifer, je fester gedrückt wird, wie eine runde Spitze auf einer Ebene.",
        "die Form von Stößel und Teil an der Berührung: Kugel oder Kante, weiche Schicht, unebener Kontakt",
    ),
    "hunt_crossley_damping": (
        "Dämpfung nach Hunt und Crossley",
        "Der Kontakt nimmt umso mehr Energie auf, je tiefer er eingedrückt wird.",
        "was zwischen Stößel und Teil liegt: Gummi, Kunststoff, weiche Auflage, lose Spitze",
    ),
    "mass_error": (
        "Falsche Masse",
        "Es bewegt sich mehr oder weniger Masse als eingetragen.",
        "die Masse des Teils: wiegen, mit allem, was sich mitbewegt (Aufnahme, Deckel, Kupplung)",
    ),
    "periodic_friction": (
        "Periodische Reibung",
        "Die Reibung steigt und fällt entlang des Tisches immer wieder.",
        "die Oberfläche des Tisches: Fräs- oder Schleifspuren der genannten Periode, Nuten, Bohrungsreihen",
    ),
    "position_dependent_friction": (
        "Ortsabhängige Reibung",
        "Die Reibung wächst stetig von einem Ende des Tisches zum anderen.",
        (
            "ungleichen Verschleiß, Schmutz oder Öl entlang des Tisches, und ob das Teil an einem Ende enger "
            "geführt ist"
        ),
    ),
    "presliding_compliance": (
        "Nachgeben vor dem Gleiten",
        "Bevor es losbricht, gibt das Teil schon ein wenig nach, wie eine Feder.",
        "weiche Schichten unter dem Teil, eine nachgebende Aufnahme, einen anderswo befestigten Sensor",
    ),
    "quadratic_drag": (
        "Quadratischer Widerstand",
        "Etwas wird verdrängt: der Widerstand wächst mit dem Quadrat der Geschwindigkeit.",
        (
            "Flüssigkeit oder Luft um das Teil: Kühlmittel auf dem Tisch, ein Film, der sich staut, "
            "ein Hohlraum, der sich leert"
        ),
    ),
    "restoring_force": (
        "Rückstellkraft",
        "Eine Kraft wie von einer Feder zieht das Teil dorthin zurück, wo es begann.",
        "Kabel, Schläuche, Bälge, Dichtungen und Federn am Teil, und ob sie gespannt sind",
    ),
    "stiction_ageing": (
        "Altern der Haftung",
        "Je länger das Teil ruht, desto schwerer löst es sich.",
        "Wartezeiten vor dem Stoß, verdrängtes Öl, klebende Kontakte; nach gleichen Ruhezeiten stoßen",
    ),
    "stribeck_friction": (
        "Stribeck-Reibung",
        "Die Reibung ist höher, solange das Teil langsam gleitet; bei Geschwindigkeit trägt ein Film.",
        "die Schmierung: Art und Menge des Öls, und ob das Teil lange genug langsam gleitet, dass es zählt",
    ),
    "surface_tilt": (
        "Neigung des Tisches",
        "Der Tisch ist nicht waagerecht: die Schwerkraft hilft in einer Richtung und hindert in der anderen.",
        "den Tisch mit einer Wasserwaage entlang der Achse; genannt in Radiant, 0,001 rad ist 1 mm je Meter",
    ),
    "viscous_friction": (
        "Viskose Reibung",
        "Der Widerstand wächst im Verhältnis zur Geschwindigkeit, wie in Öl.",
        "die Schmierung: mehr oder zäheres Öl als beim Modell, seine Temperatur, eine gedichtete Führung",
    ),
}
"""By the effect's identifier: name, meaning, and what to look at, as the object of "Nachsehen:"."""
