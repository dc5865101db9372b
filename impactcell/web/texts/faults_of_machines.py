"""Why tables of machines with several joints, or with a current for a force, cannot be used yet."""

from typing import Final

from impactcell.web.texts.fault_pattern import FaultPattern

FAULTS_OF_MACHINES: Final = (
    FaultPattern(
        r"(?:it swings|\d+ of \d+ records swing)[a-z ]*; of a pendulum give the angle .*",
        "it swings to and fro; of a pendulum choose the angle as the position in the form below",
        "es pendelt; von einem Pendel unten im Formular den Winkel als Position wählen",
    ),
    FaultPattern(
        r"columns are numbered as of (?P<count>\d+) joints, and a campaign is of one; say which: .*",
        "columns are numbered as of {count} joints, and a campaign is of one; choose the position and the "
        "force of one joint in the form below, and the columns of the others are left out",
        "die Spalten sind wie von {count} Gelenken nummeriert, eine Kampagne ist von einem; unten im "
        "Formular Position und Kraft eines Gelenks wählen, die Spalten der anderen bleiben dann weg",
    ),
    FaultPattern(
        r"has no (?P<meanings>[a-z ]+), which a campaign of excitation (?P<kind>\w+) needs; where "
        r"(?P<quote>['\"])(?P<column>.+?)(?P=quote) drives, .*",
        "has no {meanings}, which a campaign of excitation {kind} needs; where “{column}” drives, choose it "
        "as the force in the form below, with what it stands for as its gain",
        "ohne „{meanings}“, für Anregung „{kind}“ nötig; treibt „{column}“ an, sie unten im Formular als "
        "Kraft wählen und angeben, wofür sie steht",
    ),
)
"""In the order in which they are tried."""
