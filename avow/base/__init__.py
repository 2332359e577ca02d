"""What every package uses: diagnostics and their codes, files, processes, verdicts, the workspace. Knows no contract.

Start reading at: `avow.base.diagnostics` (values that say what is wrong and where), `avow.base.codes` (every code,
declared
once), `avow.base.process` (bounded runs of outside programs), `avow.base.files` (atomic writes), `avow.base.verdict`.
"""
