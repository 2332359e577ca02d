"""FRETish, the requirement language of NASA's FRET, in and out (Giannakopoulou, Pressburger, Mavridou and Schumann,
"Generation of formal requirements from structured natural language", 2020).

`sentence` reads a sentence into its fields, `meaning` expresses them as clauses, `project` makes nodes of a file, and
`writing` expresses clauses as sentences.
"""
