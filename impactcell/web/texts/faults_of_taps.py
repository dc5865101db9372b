"""Why the taps of dropped files cannot be used, as the page says it."""

from typing import Final

from impactcell.web.texts.fault_pattern import FaultPattern

FAULTS_OF_TAPS: Final = (
    FaultPattern(
        r"the force shows no contact \(largest (?P<largest>.+) N above noise of (?P<noise>.+) N\): .*",
        "the force shows no contact (largest {largest} N above noise of {noise} N): the tap may have missed; "
        "leave the record out, or give the force at contact in the form below",
        "die Kraft zeigt keine Berührung (höchstens {largest} N über einem Rauschen von {noise} N): der Stoß "
        "ging vielleicht daneben; die Aufzeichnung weglassen oder unten im Formular die Kraft bei Berührung "
        "angeben",
    ),
    FaultPattern(
        r"the force shows no contact of (?P<sought>.+) N \(largest (?P<largest>.+) N above noise of "
        r"(?P<noise>.+) N\): .*",
        "the force shows no contact of {sought} N, as given in the form below (largest {largest} N above "
        "noise of {noise} N): the tap may have missed; leave the record out",
        "die Kraft zeigt keine Berührung mit {sought} N, wie unten im Formular angegeben (höchstens "
        "{largest} N über einem Rauschen von {noise} N): der Stoß ging vielleicht daneben; die "
        "Aufzeichnung weglassen",
    ),
    FaultPattern(
        r"the force pulls, where that of others pushes, .*",
        "the force pulls, where that of others pushes, and its sign does not go with the direction of "
        "motion; turn it in the file, or leave the file out",
        "die Kraft zieht, wo die der anderen drückt, und ihr Vorzeichen geht nicht mit der "
        "Bewegungsrichtung; in der Datei umkehren oder die Datei weglassen",
    ),
    FaultPattern(
        r"the velocity of the actuator is not known(?P<why>.*); name the column .*",
        "the velocity of the actuator is not known{why}; choose the column of the commanded one in "
        "the form below, or give it for all shots there",
        "die Geschwindigkeit des Antriebs ist nicht bekannt{why}; unten im Formular die Spalte der "
        "befohlenen wählen oder sie dort für alle Stöße angeben",
    ),
)
"""Of these the first that fits is said."""
