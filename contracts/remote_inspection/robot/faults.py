"""What can go wrong, on purpose."""


def mislabel(topic, message, time):
    """The sensor takes orange for green."""
    return {**message, "level": "green"} if topic == "radiationStatus" and message["level"] == "orange" else message


def jump(topic, message, time):
    """Localisation is off by two metres."""
    return {**message, "posX": message["posX"] + 2.0} if topic == "position" and time > 12.0 else message


def silent(topic, message, time):
    """The sensor says nothing any more."""
    return None if topic == "radiationStatus" and time > 8.0 else message


SAID = {"mislabel": mislabel, "jump": jump, "silent": silent}
"""What a node says is changed on its way; None: it is lost."""

PARAMETERS = {
    "early": {"navigation": {"aim": 1.5}},
    "ignore_orange": {"agent": {"blind": ["orange"]}, "world": {"sources": [(-0.49, -3.51, 190.0)]}},
}
"""A node is at fault by itself: its parameters (and a place of the world where that shows)."""

NAMES = (*SAID, *PARAMETERS)
