"""The diagnostic codes of everything but the language and plans: backends' registry, policies, requirements, ledgers,
reports, commands. Each is declared once; `docs/diagnostics.md` lists them, and a test keeps the list in step.

A backend declares the codes of its own in its folder (`codes.py`) and shows them as an attribute `codes`.
"""

from __future__ import annotations

from collections.abc import Mapping

from avow.base.codes import CODES, Code, declare, register
from avow.base.codes_plan import PLAN_CODES
from avow.base.codes_ros import ROS_CODES
from avow.base.diagnostics import Severity

WORKSPACE_CODES = register(
    declare(
        "FRET001",
        "no FRETish file",
        "The file is neither FRET's JSON nor text with one sentence per line.",
        "Export JSON from FRET, or write such a text.",
    ),
    declare(
        "FRET002",
        "no FRETish sentence",
        "A sentence consists of scope, condition, component, `shall`, timing, `satisfy` and response.",
        "Correct it.",
    ),
    declare(
        "FRET003",
        "no clause says the sentence",
        "RCL cannot express the named part of the sentence, which is left out.",
        "Reword it in FRETish or write RCL.",
    ),
    declare(
        "FRET004",
        "FRET means something else than many expect",
        "FRET's meaning of the sentence often differs from the intention.",
        "Change the sentence if necessary.",
    ),
    declare(
        "FRET005",
        "no FRETish sentence says the clause",
        "FRETish cannot express the named part of the clause, which is left out.",
        "Reword it, or keep it in RCL.",
    ),
    declare(
        "PLAN090",
        "name taken",
        "A method has the name of one of Avow's own engines.",
        "Choose another `id`.",
    ),
    declare(
        "BACKEND001",
        "two backends of one name",
        "Two backends have the same name.",
        "Uninstall or rename one.",
    ),
    declare(
        "BACKEND002",
        "no such backend",
        "The backend is not installed.",
        "Correct the name, or name its module under `plugins`.",
    ),
    declare(
        "BACKEND003",
        "backend does not load",
        "The backend cannot be imported, or lacks a part of the protocol.",
        "Repair it (`docs/developers/adding-a-backend.md`).",
    ),
    declare(
        "BACKEND004",
        "export leaves its folder",
        "A backend writes a file outside its folder.",
        "Please report this defect.",
    ),
    declare(
        "BACKEND005",
        "plug-ins are not loaded here",
        "Commands that only read run no plug-ins of a workspace.",
        "Use `avow verify`; see `docs/trust-model.md`.",
    ),
    declare(
        "BACKEND006",
        "single steps only",
        "The method cannot judge clauses about other steps.",
        "Use another method, or remember the value in a port.",
    ),
    declare(
        "BACKEND007",
        "memory and invariant",
        "A program's state variable has a port's name, or an invariant refers to the next step.",
        "Rename the variable, or correct the invariant.",
    ),
    declare(
        "BACKEND008",
        "backend failed",
        "The backend raised an exception outside of a run.",
        "Please report this defect.",
    ),
    declare(
        "POLICY001",
        "no such profile",
        "There is no such policy profile.",
        "Use a profile of `docs/policy.md`.",
    ),
    declare(
        "POLICY002",
        "wrong policy",
        "A part of the policy has the wrong form or an impossible demand.",
        "Correct it; see `docs/policy.md`.",
    ),
    declare("POLICY003", "unknown key", "The policy has no such key here.", "Use a key of the message."),
    declare(
        "REQS001",
        "unreadable requirements",
        "The file cannot be read, or is no CSV in UTF-8.",
        "Give a CSV file with a header row, or ReqIF.",
    ),
    declare(
        "REQS002",
        "no requirements",
        "The file has no rows, texts, or specification objects.",
        "Name the column, or export again.",
    ),
    declare(
        "REQS003",
        "not acceptable XML",
        "The ReqIF file is malformed, or declares a document type or entities.",
        "Export it again without them.",
    ),
    declare(
        "REQS004",
        "wrong requirement",
        "A requirement has no text, an invalid name, or the name of another.",
        "Correct its row.",
    ),
    declare(
        "REQS005",
        "section does not read back",
        "The plan's section would read back differently, so nothing is written.",
        "Remove unusual characters, and report the defect.",
    ),
    declare(
        "SMT001",
        "no SMT-LIB form",
        "SMT-LIB cannot express a clause, which is left out.",
        "Rewrite the clause if you need this form.",
        warning=True,
    ),
    declare(
        "LEDGER001",
        "unreadable ledger",
        "The ledger cannot be read.",
        "Check the file's permissions.",
    ),
    declare(
        "LEDGER002",
        "no such obligation or evidence",
        "Nothing in the reports has this name.",
        "Use a name of the hint, or the whole id that the report shows.",
    ),
    declare(
        "SIGN001",
        "key not made",
        "The new key's file exists already, or cannot be written.",
        "Name a file that does not exist.",
    ),
    declare(
        "SIGN002",
        "nothing to sign",
        "The ledger is empty, or its chain is damaged.",
        "Run `avow verify`, or `avow audit` to see the damage.",
    ),
    declare(
        "SIGN003",
        "no key",
        "The file is no ed25519 key in PEM form.",
        "Give the key that `avow audit --new-key` made, or its `.pub`.",
    ),
    declare(
        "SIGN004",
        "signing not installed",
        "Signatures need a package.",
        "`pip install 'avow[signing]'`.",
    ),
    declare(
        "SIGN005",
        "who, until when",
        "A signature needs a name and a day that is not past.",
        'Give `--as "name, role" --until YYYY-MM-DD`.',
    ),
    declare(
        "SIGN006",
        "not what the ledger says",
        "The report differs from the ledger, contract or plan.",
        "Run `avow verify`, read the report, then sign.",
    ),
    declare(
        "REPORT001",
        "no report",
        "There is no readable report.json.",
        "Run `avow verify` first.",
    ),
    declare(
        "REPORT002",
        "not a report",
        "The file is no report of this version of Avow.",
        "Make it again with `avow report`.",
    ),
    declare(
        "DIFF001",
        "nothing to compare",
        "The argument cannot be compared.",
        "Give a report, a ledger, `signed`, the folder of another workspace, or a git revision.",
    ),
    declare(
        "DIFF002",
        "no place for the page",
        "The file of `--html` cannot be written.",
        "Name a file in a writable folder.",
    ),
    declare(
        "CLI001",
        "no workspace",
        "No folder here or above has both a `contracts/` and a `dodo.py`.",
        "Go to the workspace, or make one with `avow init DIR`.",
    ),
    declare("CLI002", "no such system", "The workspace has no such system.", "Use a name of the hint."),
    declare(
        "CLI020",
        "systems of one name",
        "Two folders under `contracts/` have systems of one name.",
        "Give each its own `system:` in plan.yaml.",
    ),
    declare(
        "CLI021",
        "plan that is not verified",
        "`avow verify` skips a plan outside `contracts/NAME/` that no system includes, or a misnamed one (plan.yml).",
        "Move it, include it under `subsystems`, or set `lints_off: [CLI021]`.",
    ),
    declare(
        "CLI022",
        "requirement that cannot be validated",
        "The plan has no such requirement, or Avow cannot edit its entry.",
        "Use a name of the hint, and block style.",
    ),
    declare(
        "CLI023",
        "no PDF",
        "Typst, which sets `report.pdf`, is missing or fails.",
        "`pip install typst`; every other format has the same content.",
    ),
    declare("CLI003", "no such node", "The contract has no such node.", "Use a name of the hint."),
    declare("CLI005", "no such derivation", "The plan has no such derivation.", "Use a name of the hint."),
    declare(
        "CLUSTER001",
        "no cluster's address",
        "Anyone who reaches a scheduler can run code.",
        "Use TLS, `dask+tls://HOST:PORT`, or this machine, `dask+tcp://127.0.0.1:PORT`.",
    ),
    declare(
        "CLUSTER002",
        "no certificate",
        "TLS needs the authority's certificate, and a certificate and key of this machine.",
        "Set AVOW_TLS_CA, AVOW_TLS_CERT and AVOW_TLS_KEY.",
    ),
    declare(
        "CLUSTER003",
        "no cluster",
        "Dask is not installed, no scheduler answers, or it rejects the certificate.",
        "Install `avow[cluster]`; start a scheduler.",
    ),
    declare(
        "CLUSTER004",
        "no workers",
        "No worker of the cluster has this version of Avow and Z3.",
        "Start one with `avow worker --on …`.",
    ),
    declare(
        "CLUSTER005",
        "certificate not accepted",
        "A certificate is expired, unreadable, or of another authority than AVOW_TLS_CA.",
        "Have the authority issue a new one.",
    ),
    declare(
        "CLUSTER006",
        "worker left the cluster",
        "A worker cannot run jobs any more (full disk, upgraded Avow).",
        "Repair and restart it.",
    ),
    declare(
        "DRIVE100",
        "nothing to drive",
        "The plan declares no callback class for the node, or its file does not exist.",
        "Write `source: {python: src/node.py, class: Node, kind: rospy}` (or `rclpy`).",
    ),
    declare(
        "DRIVE101",
        "no message class",
        "A message type is not defined, or has a field called `topic` or `time`.",
        "Name its folder under `messages`, or the distribution.",
    ),
    declare(
        "DRIVE102",
        "topics do not fit",
        "The class does not use the contract's topics with their types.",
        "Correct the contract's `topics`, the plan's `ros`, or the class.",
    ),
    declare(
        "DRIVE103",
        "cannot be driven",
        "The class uses a ROS interface that Avow does not drive, a clock, or chance.",
        "Use ROS time and a fixed seed.",
    ),
    declare(
        "DRIVE104",
        "no such messages",
        "The trace has no messages for the class, other types, or runs backwards.",
        "Give another trace.",
    ),
    declare(
        "CLI006",
        "cannot be run",
        "The scenario lacks what the message names.",
        "Complete the plan's `scenario`.",
    ),
    declare(
        "CLI007",
        "folder not empty",
        "`avow init` writes only into a new or empty folder.",
        "Name another folder.",
    ),
    declare("CLI010", "language server not installed", "`avow lsp` needs a package.", "`pip install 'avow[lsp]'`."),
    declare(
        "CLI011",
        "nothing to draft from",
        "The description cannot be read, or has no node with a topic.",
        "Give a bag, the output of `ros2 node info`, or a running master.",
    ),
)

CORE_CODES: Mapping[str, Code] = register(
    *CODES.values(), *PLAN_CODES.values(), *ROS_CODES.values(), *WORKSPACE_CODES.values()
)
"""Every code of the core: a backend's own are in its attribute `codes`."""


def page_entry(code: Code) -> str:
    """A code in `docs/diagnostics.md`."""
    mark = "" if code.severity is Severity.ERROR else f" ({code.severity})"
    return f"**{code.code}{mark}, {code.title}.** {code.explanation} {code.remedy}".strip()
