"""Where the laws of the effects come from, in German: what is said of them; titles and names stay."""

from typing import Final

from impactcell.discrepancy.report.german_patterns import Patterns

REFERENCES: Final[Patterns] = (
    (r"^Load regulation of a speed-controlled drive(?=:)",
     "Lastabhängigkeit eines drehzahlgeregelten Antriebs"),
    (r"^Trapezoidal velocity profile of motion controllers$",
     "Trapezförmiges Geschwindigkeitsprofil von Antriebssteuerungen"),
    (r"^Liquid bridge of constant volume, linearised(?=:)",
     "Flüssigkeitsbrücke konstanten Volumens, linearisiert"),
    (r"^Analysis of variance, one fixed factor$", "Varianzanalyse, ein fester Faktor"),
    (r"^Inter-channel delay of multiplexed converters(?=:)",
     "Versatz der Kanäle gemultiplexter Wandler"),
    (r"^Ratchet-like asperities(?=:)", "Sägezahnförmige Rauheit"),
    (r"^Overrange of a measuring amplifier$", "Übersteuerung eines Messverstärkers"),
    (r"^Span error(?=:)", "Skalenfehler"),
    (r"^First-order instrument(?=:)", "Messglied erster Ordnung"),
    (r"^Zero error(?=:)", "Nullpunktfehler"),
    (r"^Running-in and wear(?=:)", "Einlaufen und Verschleiß"),
    (r"^A local wear scar or contamination, as a Gaussian$",
     "Örtliche Verschleißspur oder Verschmutzung, als Gauß-Kurve"),
    (r"^Fixture or cover that moves with the part but was not weighed$",
     "Vorrichtung oder Abdeckung, die sich mitbewegt, aber nicht gewogen wurde"),
    (r"^First harmonic of a surface texture(?=:)", "Erste Harmonische einer Oberflächenstruktur"),
    (r"^First order of any slow variation of the surface$",
     "Erste Ordnung jeder langsamen Änderung der Oberfläche"),
    (r"^Hooke's law$", "Hookesches Gesetz"),
    (r"^Newtonian mechanics of the inclined plane$", "Newtonsche Mechanik der schiefen Ebene"),
    (r"^Equation \((\d+)\) of the source paper(?=;)", r"Gleichung (\1) der zugrunde liegenden Arbeit"),
    (r"\b(\w+) and (?=[A-Z][\w-]+, )", r"\1 und "),
    (r"\b(\d)rd ed\.", r"\1. Aufl."),
    (r"\bchapter (?=\d+$)", "Kapitel "),
)  # fmt: skip
"""By pattern of the English."""
