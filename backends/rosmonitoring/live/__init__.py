"""Judging while it runs: the participants of a graph (`ros1`, `dds`, `rosbridge`), what judges what they hear
(`follow`), and ROSMonitoring's oracle (`serve`)."""
