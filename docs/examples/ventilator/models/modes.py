"""The mode logic as it runs on the device."""


def step(on, pressure, last, elapsed):
    if pressure > 40 or (on and last == "alarm"):
        return {"mode": "alarm"}
    if not on:
        return {"mode": "standby"}
    if last == "standby":
        return {"mode": "inhale"}
    if last == "inhale":
        return {"mode": "inhale" if elapsed < 10 else "exhale"}
    return {"mode": "exhale" if elapsed < 20 else "inhale"}
