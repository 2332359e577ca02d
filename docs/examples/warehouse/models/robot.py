"""The scanner's node."""

BEAMS = 8


def scanner(scan):
    return {"nearest": min(scan(beam) for beam in range(BEAMS))}
