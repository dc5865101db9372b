"""Why a tap shows no friction, or shows it less well, in German: patterns of what features and estimates say.

A reason that has a semicolon in it is said part by part.
"""

from collections.abc import Mapping
from typing import Final

TAP_REASONS: Final[Mapping[str, str]] = {
    r"no waveform estimate: (.+)": r"keine Schätzung aus dem ganzen Verlauf: \1",
    r"the model misses this tap: residuals are (\S+) times the noise":
        r"das Modell trifft diesen Stoß nicht: die Abweichung ist \1-mal das Rauschen",
    r"the model misses these taps: residuals are (\S+) times the noise":
        r"das Modell trifft diese Stöße nicht: die Abweichung ist \1-mal das Rauschen",
    r"the model misses this slide: residuals by eighths of a slide are (\S+) times noise":
        r"das Modell trifft diesen Gleitvorgang nicht: die Abweichung, über Achtel gemittelt, "
        r"ist \1-mal das Rauschen",
    r"the model misses these slides: residuals by eighths of a slide are (\S+) times noise":
        r"das Modell trifft diese Gleitvorgänge nicht: die Abweichung, über Achtel gemittelt, "
        r"ist \1-mal das Rauschen",
    r"constant friction misses this slide: residuals by eighths of a slide are (\S+) times noise":
        r"gleichbleibende Reibung trifft diesen Gleitvorgang nicht: die Abweichung, über Achtel gemittelt, "
        r"ist \1-mal das Rauschen",
    r"constant friction misses these slides: residuals by eighths of a slide are (\S+) times noise":
        r"gleichbleibende Reibung trifft diese Gleitvorgänge nicht: die Abweichung, über Achtel gemittelt, "
        r"ist \1-mal das Rauschen",
    r"run `impactcell discrepancy`": "`impactcell discrepancy` ausführen",
    r"a free slide shows mu_k only": "freies Gleiten zeigt nur µk",
    r"the model does not make this tap: (.+)": r"das Modell ergibt diesen Stoß nicht: \1",
    r"the waveform fit did not settle": "die Anpassung an den Verlauf kam nicht zur Ruhe",
    r"the waveform does not show friction": "der Verlauf zeigt die Reibung nicht",
    r"the fit is singular: (.+)": "die Anpassung ist nicht eindeutig",
    r"(\d+) outliers? of the force left out": r"\1 Ausreißer der Kraft weggelassen",
    r"(\d+) outliers? of the position left out": r"\1 Ausreißer des Wegs weggelassen",
    r"(\d+) outliers? of the actuator left out": r"\1 Ausreißer des Aktorwegs weggelassen",
    r"(\d+) lost samples? of the force left out: check its cable and link":
        r"verlorene Werte der Kraft weggelassen (\1): Kabel und Verbindung prüfen",
    r"(\d+) lost samples? of the position left out: check its cable and link":
        r"verlorene Werte des Wegs weggelassen (\1): Kabel und Verbindung prüfen",
    r"force stands at (\S+) N without contact, taken off: tare its sensor":
        r"die Kraft steht ohne Kontakt bei \1 N, abgezogen: den Sensor nullen",
    r"force pulls with (\S+) N, where a contact only pushes: turn its sign in the module or at its amplifier":
        r"die Kraft zieht mit \1 N, wo ein Kontakt nur drückt: ihr Vorzeichen im Modul oder am Verstärker "
        r"umdrehen",
    r"the part moved (\S+) mm against the tap's direction (\S+): turn the sign of position in the module, "
    r"or put direction right":
        r"das Teil bewegte sich \1 mm gegen die Richtung des Stoßes, \2: das Vorzeichen des Wegs im Modul "
        r"umdrehen oder die Richtung richtigstellen",
    r"force gave the part (\S+) N s, its motion shows (\S+) N s: see unit and scale of force, position and "
    r"mass, and the sampling rates":
        r"die Kraft gab dem Teil \1 N s, seine Bewegung zeigt \2 N s: Einheit und Maßstab von Kraft, Weg und "
        r"Masse und die Abtastraten prüfen",
    r"as if force were recorded (\S+) µs late against position: check its filter and clock":
        r"als wäre die Kraft um \1 µs später aufgezeichnet als der Weg: Filter und Takt dieses Kanals prüfen",
    r"as if position were recorded (\S+) µs late against force: check its filter and clock":
        r"als wäre der Weg um \1 µs später aufgezeichnet als die Kraft: Filter und Takt dieses Kanals prüfen",
    r"as if force stood (\S+) N off its zero: tare its sensor":
        r"als stünde die Kraft \1 N neben ihrer Null: den Sensor nullen",
    r"as if position stood (\S+) µm off its zero: check where it is counted from":
        r"als stünde der Weg \1 µm neben seiner Null: prüfen, von wo er gezählt wird",
    r"as if friction were (\S+) larger in slow slip, its first and last mm/s: run `impactcell discrepancy`":
        r"als wäre die Reibung in langsamem Gleiten, den ersten und letzten mm/s, um \1 größer: "
        r"`impactcell discrepancy` ausführen",
    r"as if friction were (\S+) smaller in slow slip, its first and last mm/s: run `impactcell discrepancy`":
        r"als wäre die Reibung in langsamem Gleiten, den ersten und letzten mm/s, um \1 kleiner: "
        r"`impactcell discrepancy` ausführen",
    r"or (as if .+)": r"oder \1",
    r"as if first contact lay (\S+) µs after t = 0: check the trigger":
        r"als läge der erste Kontakt \1 µs nach t = 0: den Trigger prüfen",
    r"as if first contact lay (\S+) µs before t = 0: check the trigger":
        r"als läge der erste Kontakt \1 µs vor t = 0: den Trigger prüfen",
    r"from the mean deceleration of the slide": "aus der mittleren Verzögerung des Gleitens",
    r"no plant could be fitted to these taps": "an diese Stöße ließ sich kein Modell anpassen",
    r"through mu_k/mu_s of the model": "über µk/µs des Modells",
    r"by sliding distance only: (.+)": r"nur aus dem Gleitweg: \1",
    r"by peak force only: (.+)": r"nur aus der Spitzenkraft: \1",
    r"the module reports a peak force of (\S+) N and no record":
        r"das Modul meldet eine Spitzenkraft von \1 N und keine Aufzeichnung",
    r"(.+), and the module reports a sliding distance of (\S+)":
        r"\1, und das Modul meldet einen Gleitweg von \2 m",
    r"model '(.+)' has no predictors: run `impactcell calibrate` on its cell":
        r"das Modell „\1“ hat keine Gleichungen: `impactcell calibrate` für seine Zelle ausführen",
    r"the part's mass is not known": "die Masse des Teils ist nicht bekannt",
    r"the actuator's velocity is not known": "die Geschwindigkeit des Aktors ist nicht bekannt",
    r"the part's mass or the actuator's velocity is not known":
        "die Masse des Teils oder die Geschwindigkeit des Aktors ist nicht bekannt",
    r"peak force (\S+) N is below that of a part without friction":
        r"die Spitzenkraft \1 N liegt unter der eines Teils ohne Reibung",
    r"sliding distance (\S+) µm is below (\S+) µm, the shortest for which equation \(5\) has a root at "
    r"(\S+) m/s":
        r"der Gleitweg \1 µm liegt unter \2 µm, dem kürzesten, für den Gleichung (5) bei \3 m/s eine "
        r"Lösung hat",
    r"sliding distance (\S+) µm is that of a part without friction":
        r"der Gleitweg \1 µm ist der eines Teils ohne Reibung",
    r"check mass and velocity": "Masse und Geschwindigkeit prüfen",
    r"the model is provisional: run `impactcell model fit` after 30 taps":
        "das Modell ist vorläufig: nach 30 Stößen `impactcell model fit` ausführen",
    r"check mass, stroke and velocity": "Masse, Hub und Geschwindigkeit prüfen",
    r"the (force|position) record is empty": r"die Aufzeichnung von \1 ist leer",
    r"the (force|position) record has (\d+) samples at (\d+) times":
        r"die Aufzeichnung von \1 hat \2 Werte zu \3 Zeiten",
    r"(\d+) of (\d+) (force|position) samples are not numbers": r"\1 von \2 Werten von \3 sind keine Zahlen",
    r"the (force|position) record has only (\d+) samples": r"die Aufzeichnung von \1 hat nur \2 Werte",
    r"the times of the (force|position) record do not increase":
        r"die Zeiten der Aufzeichnung von \1 nehmen nicht zu",
    r"the (force|position) is constant at (\S+)": r"\1 bleibt unverändert bei \2",
    r"the part moved less than (\S+) m": r"das Teil bewegte sich um weniger als \1 m",
    r"no contact: the force stays below (\S+) N, noise is (\S+) N":
        r"kein Kontakt: die Kraft bleibt unter \1 N, das Rauschen ist \2 N",
    r"(\d+) force samples are at full scale, (\S+) N": r"\1 Werte der Kraft stehen am Messbereichsende, \2 N",
    r"(\d+) force samples in a row stand at (\S+) N: clipped":
        r"\1 Werte der Kraft hintereinander stehen bei \2 N: abgeschnitten",
    r"the force was still (\S+) N when its record ended":
        r"die Kraft war noch \1 N, als ihre Aufzeichnung endete",
    r"contact was lost only when the position record ended":
        "der Kontakt endete erst mit der Aufzeichnung der Position",
    r"the slide after the last contact is too short for its position samples: where the actuator caught up "
    r"with the part, tap faster or with a shorter stroke":
        "das Gleiten nach dem letzten Kontakt ist zu kurz für die Werte der Position: wo der Aktor das Teil "
        "einholte, schneller oder mit kürzerem Hub stoßen",
    r"the part was still moving at (\S+) mm/s when the record ended":
        r"das Teil bewegte sich noch mit \1 mm/s, als die Aufzeichnung endete",
    r"the capture has no position channel": "die Position wurde nicht aufgezeichnet",
    r"the position channel has (\d+) usable samples": r"die Position hat \1 brauchbare Werte",
    r"(\d+) position samples after loss of contact": r"\1 Werte der Position nach dem Ende des Kontakts",
    r"the position is constant": "die Position bleibt unverändert",
    r"the part did not slide": "das Teil glitt nicht",
    r"the part did not slow down": "das Teil wurde nicht langsamer",
    r"the model's effects slow a part down more than this one was: check its mass":
        "die Effekte des Modells bremsen ein Teil stärker, als dieses gebremst wurde: seine Masse prüfen",
    r"the slide is too short to show its deceleration":
        "das Gleiten ist zu kurz, um die Verzögerung zu zeigen",
}  # fmt: skip
"""German of each pattern."""
