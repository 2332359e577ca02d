"""Judging while it runs: the participants of a graph (`ros1`, `dds`), the loop that judges their messages (`follow`),
and ROSMonitoring's oracle (`serve`)."""
