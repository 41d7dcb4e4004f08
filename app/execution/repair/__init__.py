"""What to do about a board that is not as it should be: put right what is sure, ask people for the rest.

``observed`` is what the camera reports, ``belief`` finds which pieces must stand there, and doubts it where two
moves would look the same, ``diagnosis`` says what the arm does and what a person has to. With depth,
``by_sight`` comes first: it finds which piece each of all that is seen to stand is. Pure: nothing here looks or
moves.
"""

from app.execution.repair.by_sight import Whereabouts, placed, repair_by_sight, whereabouts
from app.execution.repair.diagnosis import Ask, Repair, mend, repair_towards
from app.execution.repair.faults_by_depth import exchanged, known_better, refuted, toppled
from app.execution.repair.observed import BoardObservation, kinds_by_height

__all__ = [
    "Ask", "BoardObservation", "Repair", "Whereabouts", "exchanged", "kinds_by_height", "known_better", "mend",
    "placed", "refuted", "repair_by_sight", "repair_towards", "toppled", "whereabouts",
]  # fmt: skip
