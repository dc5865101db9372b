"""German descriptions of nodes, by the English ones."""

from collections.abc import Mapping
from typing import Final

DESCRIPTIONS: Final[Mapping[str, str]] = {
    "Adds a comment to the condition.": "Fügt der Meldung einen Kommentar hinzu.",
    "All machines of this server.": "Alle Maschinen dieses Servers.",
    "Arguments of the method.": "Argumente der Methode.",
    "Change of Level in 1000 cycles.": "Änderung des Niveaus in 1000 Zyklen.",
    "Class of device.": "Klasse des Geräts.",
    "Class of the condition: process, maintenance or system.": "Klasse: Prozess, Instandhaltung oder System.",
    "Coefficient of kinetic friction of the last cycle.": "Gleitreibungszahl des letzten Zyklus.",
    "Coefficient of static friction from the peak force alone.": "Haftreibungszahl aus der Spitzenkraft.",
    "Coefficient of static friction from the sliding distance alone.": "Haftreibungszahl aus dem Gleitweg.",
    "Coefficient of static friction of the last cycle, by the estimator in use.": (
        "Haftreibungszahl des letzten Zyklus nach dem verwendeten Schätzer."
    ),
    "Commanded velocity of the actuator.": "Befohlene Geschwindigkeit des Aktors.",
    "Comment of the last action on the condition.": "Kommentar der letzten Handlung an der Meldung.",
    "Cycle of the last change of state.": "Zyklus der letzten Zustandsänderung.",
    "Cycles received since the service started.": "Empfangene Zyklen seit dem Start des Dienstes.",
    "Cycles the module counted but the service never saw or stored.": (
        "Vom Modul gezählte Zyklen, die nie ankamen oder nicht gespeichert sind."
    ),
    "Cycles until Level reaches Limit; +Infinity where it does not.": (
        "Zyklen, bis das Niveau die Grenze erreicht; +Unendlich, wenn es das nicht tut."
    ),
    "Designed mean number of cycles between false alarms.": "Ausgelegte mittlere Zyklenzahl je Fehlalarm.",
    "Distance slid since loss of contact, on the fixed grid of the cell.": (
        "Gleitweg seit dem Verlust des Kontakts, im festen Raster der Zelle."
    ),
    "Distance that is left to Target.": "Abstand, der bis zum Ziel bleibt.",
    "Distance the part slid between loss of contact and rest.": (
        "Weg, den das Teil vom Verlust des Kontakts bis zur Ruhe glitt."
    ),
    "Ends the positioning task that runs; no further tap is commanded.": (
        "Beendet die laufende Positionieraufgabe; kein weiterer Stoß wird befohlen."
    ),
    "Estimated first cycle after the change; 0 without one.": (
        "Geschätzter erster Zyklus nach der Änderung; 0 ohne eine."
    ),
    "Estimated size of the change, in the unit of what is watched.": (
        "Geschätzte Größe der Änderung, in der Einheit des Überwachten."
    ),
    "First cycle after the last shift; 0 before the first.": (
        "Erster Zyklus nach dem letzten Sprung; 0 vor dem ersten."
    ),
    "Friction followed over time, at the reference batch.": "Reibung im Lauf der Zeit, bei der Bezugscharge.",
    "Friction of the last cycle.": "Reibung des letzten Zyklus.",
    "Globally unique identifier of the machine.": "Weltweit eindeutige Kennung der Maschine.",
    "Hotelling's T squared of the leading components.": "Hotellings T² der führenden Komponenten.",
    "How aggregates treat values that are not Good.": "Wie Aggregate Werte behandeln, die nicht gut sind.",
    "How the history of this variable is kept and aggregated.": (
        "Wie die Historie dieser Größe gehalten und zusammengefasst wird."
    ),
    "Identifier of the last event of the condition.": "Kennung des letzten Ereignisses der Meldung.",
    "Keeps the alarm from people for a time.": "Hält die Meldung eine Zeit lang zurück.",
    "Keeps the alarm from people until it has ended once.": "Hält die Meldung zurück, bis sie einmal endet.",
    "Kinetic friction along the stroke of the last cycle.": "Gleitreibung entlang des letzten Wegs.",
    "Kinetic friction at each Position; NaN where the part did not get that far.": (
        "Gleitreibung an jeder Stelle; NaN, wo das Teil nicht so weit kam."
    ),
    "Largest contact force of the last cycle.": "Größte Kontaktkraft des letzten Zyklus.",
    "Level at which the cell counts as worn.": "Niveau, ab dem die Zelle als verschlissen gilt.",
    "Longest time the alarm can be shelved, ms.": "Längste Zeit der Zurückstellung, ms.",
    "Lower end of the 95 % interval of CyclesToLimit.": "Unteres Ende des 95-%-Bereichs der übrigen Zyklen.",
    "Misfit of model and measurement; 1 is the noise of the sensors.": (
        "Abweichung von Modell und Messung; 1 ist das Rauschen der Sensoren."
    ),
    "Model of the machine.": "Modell der Maschine.",
    "Month of construction, 1 to 12.": "Baumonat, 1 bis 12.",
    "Name of the cell.": "Name der Zelle.",
    "Name of the class of the condition.": "Name der Klasse der Meldung.",
    "Name of the condition.": "Name der Meldung.",
    "Name of the manufacturer.": "Name des Herstellers.",
    "Name of the model.": "Name des Modells.",
    "Name of the present batch.": "Name der jetzigen Charge.",
    "Name the operator gives the asset.": "Name, den der Betreiber vergibt.",
    "Name the operator gives the machine.": "Name, den der Betreiber der Maschine gibt.",
    "Null: this server keeps no earlier states of a condition apart.": (
        "Leer: frühere Zustände einer Meldung werden nicht getrennt gehalten."
    ),
    "Number of the last cycle, as the module counts.": "Nummer des letzten Zyklus, wie das Modul zählt.",
    "One standard deviation of KineticFriction.": "Eine Standardabweichung der Gleitreibung.",
    "One standard deviation of LastShift.": "Eine Standardabweichung des letzten Sprungs.",
    "One standard deviation of Level.": "Eine Standardabweichung des Niveaus.",
    "One standard deviation of what may be wrong in Level alike in all cycles, beside LevelStdDev.": (
        "Eine Standardabweichung dessen, was am Niveau in allen Zyklen gleich falsch sein kann, "
        "neben LevelStdDev."
    ),
    "One standard deviation of Offset.": "Eine Standardabweichung des Abstands.",
    "One standard deviation of RatePer1000Cycles.": "Eine Standardabweichung der Änderung in 1000 Zyklen.",
    "One standard deviation of Size.": "Eine Standardabweichung der Größe.",
    "One standard deviation of StaticFriction.": "Eine Standardabweichung der Haftreibung.",
    "One standard deviation of StaticFrictionByDistance.": (
        "Eine Standardabweichung der Haftreibung aus dem Gleitweg."
    ),
    "One standard deviation of StaticFrictionByForce.": (
        "Eine Standardabweichung der Haftreibung aus der Spitzenkraft."
    ),
    "Present state.": "Jetziger Zustand.",
    "Product code of the manufacturer.": "Produktcode des Herstellers.",
    "Range the value is expected to stay in.": "Bereich, in dem der Wert erwartet wird.",
    "Revision of the hardware.": "Stand der Hardware.",
    "Revision of the software.": "Stand der Software.",
    "Says that the alarm has been seen.": "Sagt, dass die Meldung gesehen wurde.",
    "Says that what was to be done has been done.": "Sagt, dass getan ist, was zu tun war.",
    "Serial number given by the manufacturer.": "Seriennummer des Herstellers.",
    "Severity before it last changed; 0 while it has not.": (
        "Dringlichkeit vor ihrer letzten Änderung; 0, solange es keine gab."
    ),
    "Share of Bad values from which an aggregate is Bad, %.": (
        "Anteil schlechter Werte, ab dem ein Aggregat schlecht ist, %."
    ),
    "Share of Good values from which an aggregate is Good, %.": (
        "Anteil guter Werte, ab dem ein Aggregat gut ist, %."
    ),
    "Shows the alarm to people again.": "Zeigt die Meldung wieder.",
    "Size of the last shift between batches, as estimated by now; BatchShift has it as it was found.": (
        "Größe des letzten Sprungs zwischen Chargen, nach jetziger Schätzung; BatchShift hat sie, wie er "
        "gefunden wurde."
    ),
    "Squared prediction error, in units of the noise.": "Quadrierter Restfehler, in Einheiten des Rauschens.",
    "TSquared from which on it makes a cycle deviant by itself.": (
        "TSquared, ab dem es allein einen Zyklus abweichend macht."
    ),
    "Spe from which on it makes a cycle deviant by itself.": (
        "Spe, ab dem es allein einen Zyklus abweichend macht."
    ),
    "Starts a positioning task.": "Beginnt eine Positionieraufgabe.",
    "Static friction at the reference batch, filtered over cycles.": (
        "Haftreibung bei der Bezugscharge, über Zyklen gefiltert."
    ),
    "Static friction of the present batch less that of the reference batch.": (
        "Haftreibung der jetzigen Charge abzüglich der Bezugscharge."
    ),
    "Status of what the condition rests on.": "Status dessen, worauf die Meldung beruht.",
    "Stroke of the tap that comes next.": "Hub des nächsten Stoßes.",
    "Takes the condition into use.": "Schaltet die Meldung ein.",
    "Takes the condition out of use.": "Schaltet die Meldung aus.",
    "Tells the cell that another batch of material begins.": (
        "Sagt der Zelle, dass eine andere Charge beginnt."
    ),
    "Tells the cell that worn parts have been replaced; the wear level is learned anew.": (
        "Sagt der Zelle, dass verschlissene Teile ersetzt sind; das Niveau wird neu gelernt."
    ),
    "The cell.": "Die Zelle.",
    "The cells of this server.": "Die Zellen dieses Servers.",
    "The link to the module.": "Die Verbindung zum Modul.",
    "The model that the estimators use.": "Das Modell, das die Schätzer verwenden.",
    "The positioning task that runs, if one does.": "Die laufende Positionieraufgabe, wenn es eine gibt.",
    "The present batch of material against the reference batch.": "Jetzige Charge gegen die Bezugscharge.",
    "The same in days at the present rate of cycles.": "Dasselbe in Tagen beim jetzigen Takt.",
    "The state as a value that does not depend on a language.": "Der Zustand, unabhängig von der Sprache.",
    "The state of the condition in one expression.": "Der Zustand der Meldung in einem Ausdruck.",
    "Time between a request to the module and its answer.": "Zeit von der Frage ans Modul zur Antwort.",
    "Time until the shelving ends, ms.": "Zeit bis zum Ende der Zurückstellung, ms.",
    "True while the module answers.": "Wahr, solange das Modul antwortet.",
    "True: between two stored values the earlier one holds.": (
        "Wahr: zwischen zwei gespeicherten Werten gilt der frühere."
    ),
    "Type of the condition.": "Typ der Meldung.",
    "URI of the manufacturer.": "URI des Herstellers.",
    "Upper end of the 95 % interval of CyclesToLimit.": "Oberes Ende des 95-%-Bereichs der übrigen Zyklen.",
    "Urgency, 1 to 1000.": "Dringlichkeit, 1 bis 1000.",
    "User of the last action on the condition.": "Benutzer der letzten Handlung an der Meldung.",
    "Variable that the alarm watches; null where it is no single one.": (
        "Größe, die überwacht wird; leer, wo es keine einzelne ist."
    ),
    "Velocity of the tap that comes next.": "Geschwindigkeit des nächsten Stoßes.",
    "What Statistic was compared with; NaN without one.": "Womit die Prüfgröße verglichen wurde; sonst NaN.",
    "What has happened, in words.": "Was geschehen ist, in Worten.",
    "What was compared with Threshold; NaN without one.": "Was mit der Schwelle verglichen wurde; sonst NaN.",
    "When it happened.": "Wann es geschah.",
    "When the machine was first put into operation.": "Wann die Maschine zuerst in Betrieb ging.",
    "When the server had the event.": "Wann der Server das Ereignis hatte.",
    "When the state was entered.": "Wann der Zustand begann.",
    "When the value last changed.": "Wann sich der Wert zuletzt änderte.",
    "Where the machine stands.": "Wo die Maschine steht.",
    "Where the part is to go, along +1.": "Wohin das Teil soll, in Richtung +1.",
    "Whether Uncertain values count as Bad in aggregates.": "Ob unsichere Werte in Aggregaten schlecht sind.",
    "Whether aggregates extrapolate along a slope.": "Ob Aggregate mit einer Steigung extrapolieren.",
    "Whether and how the alarm is kept from people for a while.": (
        "Ob und wie die Meldung eine Weile zurückgehalten wird."
    ),
    "Whether somebody has seen the alarm.": "Ob jemand die Meldung gesehen hat.",
    "Whether the alarm has been taken out of service.": "Ob die Meldung außer Betrieb ist.",
    "Whether the alarm is kept from people for any reason.": "Ob die Meldung zurückgehalten wird.",
    "Whether the cell itself keeps the alarm from people.": "Ob die Zelle selbst die Meldung unterdrückt.",
    "Whether the condition is in use.": "Ob die Meldung eingeschaltet ist.",
    "Whether the condition is shown on a refresh.": "Ob die Meldung bei einer Auffrischung gezeigt wird.",
    "Whether what the alarm stands for is so now.": "Ob das, wofür die Meldung steht, jetzt zutrifft.",
    "Whether what was to be done has been done.": "Ob getan ist, was zu tun war.",
    "Who made the machine and which one it is, after OPC 40001-1.": (
        "Wer die Maschine gebaut hat und welche es ist, nach OPC 40001-1."
    ),
    "Year of construction.": "Baujahr.",
}
"""By description."""
