"""The diagnostic codes of everything but the language and plans: backends' registry, policies, requirements, ledgers,
reports, commands. Each is declared once; `docs/diagnostics.md` lists them, and a test keeps the list in step.

A backend declares the codes of its own in its folder (`codes.py`) and shows them as an attribute `codes`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from avow.base.codes import CODES, Code, declare, register
from avow.base.codes_plan import PLAN_CODES
from avow.base.codes_ros import ROS_CODES

WORKSPACE_CODES = register(
    declare(
        "FRET001",
        "no FRETish file",
        "The file cannot be read, or is neither text with a sentence on a line nor JSON as FRET exports it.",
        "Export the requirements from FRET as JSON, or write the sentences into a text file.",
    ),
    declare(
        "FRET002",
        "no FRETish sentence",
        "A sentence is: scope, condition, component, `shall`, timing, `satisfy`, response, in FRET's grammar.",
        "Correct it at the place that is shown; FRET's own editor colours its fields.",
    ),
    declare(
        "FRET003",
        "no clause says the sentence",
        "RCL has no counterpart for something that the sentence says; the message names it. It is left out.",
        "Say it another way, in FRETish or in RCL.",
    ),
    declare(
        "FRET004",
        "FRET means something else than many expect",
        "The clause means what FRET makes of the sentence, which is often not what was meant.",
        "Read what the message says of it, and change the sentence if that was not meant.",
    ),
    declare(
        "FRET005",
        "no FRETish sentence says the clause",
        "FRETish has no counterpart for something that the clause says; the message names it. It is left out.",
        "Say it another way, or keep it in RCL.",
    ),
    declare(
        "PLAN090",
        "name taken",
        "A method of the plan has the name of one of Avow's own engines, whose evidence it would be mistaken for.",
        "Give the method another `id`.",
    ),
    declare(
        "BACKEND001",
        "two backends of one name",
        "Two installed packages, or a package and a plugin of the plan, claim the same name.",
        "Uninstall one of them, or rename the plugin's backend.",
    ),
    declare(
        "BACKEND002",
        "no such backend",
        "The plan names a backend that is neither installed nor one of its plugins.",
        "Correct the name (the hint has those there are), or name its module under `plugins`.",
    ),
    declare(
        "BACKEND003",
        "backend does not load",
        "Importing the backend failed, or the object lacks a part of the backend protocol.",
        "Repair it; the message has the reason, and `docs/adding-a-backend.md` the protocol.",
    ),
    declare(
        "BACKEND004",
        "export leaves its folder",
        "A backend wants to write a generated file outside the folder that it was given.",
        "This is a defect of the backend: tell its authors.",
    ),
    declare(
        "BACKEND005",
        "plug-ins are not loaded here",
        "The plan names plug-in modules. They are code, and commands that only read execute nothing of a workspace.",
        "`avow verify` loads them; see `docs/trust-model.md`.",
    ),
    declare(
        "BACKEND006",
        "single steps only",
        "The method judges single steps, or not all that can be said of others, and the clause, or an assumption of "
        "its node, speaks of others.",
        "Give the guarantee a method that judges runs, or say it with a port that carries what is remembered.",
    ),
    declare(
        "BACKEND007",
        "memory and invariant",
        "What a program keeps from step to step has the name of a port, or an invariant that links it to the steps "
        "before speaks of the step that is to come.",
        "Use another name; an invariant speaks of what the program keeps, and of the past (`previous(in.r, 0)`).",
    ),
    declare(
        "BACKEND008",
        "backend failed",
        "Something of the backend that Avow asks in its own process (all but the run itself) raised an exception.",
        "This is a defect of the backend: tell its authors. The message has its place.",
    ),
    declare(
        "POLICY001",
        "no such profile",
        "The plan names a policy profile that does not exist.",
        "Use one of those listed in `docs/policy.md`.",
    ),
    declare(
        "POLICY002",
        "wrong policy",
        "A part of the policy has the wrong form, or demands what no method can give.",
        "Correct the place that the message names; `docs/policy.md` has the form.",
    ),
    declare(
        "POLICY003", "unknown key", "The policy has no such key at this place.", "Use one of the keys in the message."
    ),
    declare(
        "REQS001",
        "unreadable requirements",
        "The file of requirements cannot be read, is not UTF-8, or is no CSV.",
        "Give a CSV file with a header row, or ReqIF.",
    ),
    declare(
        "REQS002",
        "no requirements",
        "The file has no rows, no column with the text of the requirements, or no specification objects.",
        "Name the column as the message says, or export the requirements again.",
    ),
    declare(
        "REQS003",
        "not acceptable XML",
        "The ReqIF file is not well formed, or declares a document type or entities, which are never expanded.",
        "Export it again, without a document type.",
    ),
    declare(
        "REQS004",
        "wrong requirement",
        "A requirement has no text, a name that cannot be one, or the name of another.",
        "Correct the row in the file that it came from.",
    ),
    declare(
        "REQS005",
        "section does not read back",
        "Written as a section of a plan and read again, a requirement would not be the same; nothing is written.",
        "Remove unusual characters from its text in the file that it came from, and tell Avow's authors.",
    ),
    declare(
        "SMT001",
        "no SMT-LIB form",
        "A formula of the node is outside what can be written in SMT-LIB.",
        "Rewrite the formula that the message names; the other commands do not need this form.",
    ),
    declare(
        "LEDGER001",
        "unreadable ledger",
        "The ledger's file exists but cannot be read.",
        "Check the file's permissions.",
    ),
    declare(
        "LEDGER002",
        "no such obligation or evidence",
        "Nothing in the reports has the name that was given.",
        "Use a name from the hint, or the whole id that the report shows.",
    ),
    declare(
        "SIGN001",
        "key not made",
        "The new key's file exists already, or cannot be written. A key is never overwritten.",
        "Name a file that does not exist.",
    ),
    declare(
        "SIGN002",
        "nothing to sign",
        "The ledger has no records, or its chain is damaged; such a ledger is not signed.",
        "Run `avow verify`; look at the damage with `avow audit`.",
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
        "Signatures need a package that is not installed.",
        "`pip install 'avow[signing]'`.",
    ),
    declare(
        "SIGN005",
        "who, until when",
        "A signature needs a name and a day of the calendar that is not past.",
        'Give `--as "name, role" --until YYYY-MM-DD`.',
    ),
    declare(
        "SIGN006",
        "not what the ledger says",
        "The report does not say what the ledger says, or contract and plan have changed since: nobody should sign it.",
        "Run `avow verify`, read the report, and sign then.",
    ),
    declare(
        "REPORT001",
        "no report",
        "There is no report.json where one is needed, or it cannot be read.",
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
        "What was given is neither a report, nor a ledger, nor a revision that git knows.",
        "Give a `report.json`, a ledger, or a commit.",
    ),
    declare(
        "DIFF002",
        "no place for the page",
        "The page with the changes cannot be written where `--html` says.",
        "Name a file in a folder that is there and may be written to.",
    ),
    declare(
        "CLI001",
        "no workspace",
        "No folder here or above has both a `contracts/` and a `dodo.py`.",
        "Go to the workspace, or make one with `avow init DIR`.",
    ),
    declare("CLI002", "no such system", "The workspace has no system of that name.", "Use a name from the hint."),
    declare(
        "CLI020",
        "systems of one name",
        "Two folders under contracts/ hold systems of one name; their evidence and reports would be mixed up.",
        "Give each its own `system:` in plan.yaml; a link to another system's folder is to be removed.",
    ),
    declare(
        "CLI021",
        "plan that is not verified",
        "A plan lies elsewhere than in `contracts/NAME/`, and `avow verify` leaves it out: the system around it does "
        "not take it in (a warning), or there is none around it, and none takes it in (an error). So does a file that "
        "is nearly called plan.yaml (plan.yml).",
        "Move its folder into `contracts/`, or take it in under `subsystems`; where a warning's plan is to be left "
        "out, `lints_off: [CLI021]` in the plan of the system around it says so.",
    ),
    declare("CLI003", "no such node", "The contract has no node of that name.", "Use a name from the hint."),
    declare("CLI005", "no such derivation", "The plan has no derivation of that name.", "Use a name from the hint."),
    declare(
        "CLUSTER001",
        "no cluster's address",
        "A cluster is reached by TLS, or without it on this machine only: who reaches a scheduler runs code there.",
        "Write `dask+tls://HOST:PORT`, or `dask+tcp://127.0.0.1:PORT`.",
    ),
    declare(
        "CLUSTER002",
        "no certificate",
        "A connection by TLS needs the files of the authority's certificate, and of this side's certificate and key.",
        "Set AVOW_TLS_CA, AVOW_TLS_CERT and AVOW_TLS_KEY.",
    ),
    declare(
        "CLUSTER003",
        "no cluster",
        "Dask is not installed here, no scheduler answers at the address, or it does not accept the certificate.",
        "Install `avow[cluster]`; start a scheduler (`docs/scale.md`).",
    ),
    declare(
        "CLUSTER004",
        "no workers",
        "The cluster has no workers, or none with this Avow and this Z3: nothing would ever be done.",
        "Start one with `avow worker --on …`, of the same version.",
    ),
    declare(
        "CLUSTER005",
        "certificate not accepted",
        "A certificate has expired, is not of the authority that AVOW_TLS_CA names, or cannot be read: whose, it says.",
        "Have the authority issue a new one.",
    ),
    declare(
        "CLUSTER006",
        "worker left the cluster",
        "A worker that can do no works any more (its disk is full, or its Avow was upgraded) leaves: others do them.",
        "Mend what it names, and start it again.",
    ),
    declare(
        "DRIVE100",
        "nothing to drive",
        "The plan declares no callback class as the node, or there is no such node, or no such file.",
        "Write `source: {python: src/node.py, class: Node, kind: rospy}` for the node (or `kind: rclpy`).",
    ),
    declare(
        "DRIVE101",
        "no message class",
        "A message type that the class needs is not defined, or has a field called `topic` or `time`.",
        "Name the folder of its definition under `messages`, or the distribution under `ros`.",
    ),
    declare(
        "DRIVE102",
        "topics do not fit",
        "The class does not subscribe to a topic of the contract's inputs, does not publish one of its outputs, or "
        "does so with another type.",
        "Correct the contract's `topics`, the plan's `ros: {nodes: …}`, or the class.",
    ),
    declare(
        "DRIVE103",
        "cannot be driven",
        "The class asks for something of ROS that is not driven, hangs on a clock or on chance, or cannot be run.",
        "The message names it. Time is ROS' own (`rospy.Time.now()`, `get_clock().now()`); chance needs a fixed seed.",
    ),
    declare(
        "DRIVE104",
        "no such messages",
        "The trace has nothing for this class, its times run backwards, or a message is not of its topic's type.",
        "Correct the trace, or name another.",
    ),
    declare(
        "CLI006",
        "cannot be run",
        "The system cannot be simulated: the message says what is missing, such as an interpretation or a domain.",
        "Complete the plan's `scenario`.",
    ),
    declare(
        "CLI007",
        "folder not empty",
        "`avow init` writes only into a new or empty folder.",
        "Name another folder.",
    ),
    declare("CLI010", "language server not installed", "`avow lsp` needs pygls.", "`pip install 'avow[lsp]'`."),
    declare(
        "CLI011",
        "nothing to draft from",
        "What `avow init` is to draft a system from cannot be read, or has no node with a topic.",
        "Give a bag, the output of `rosnode info` or `ros2 node info`, or the address of a running master.",
    ),
)

CORE_CODES: Mapping[str, Code] = register(
    *CODES.values(), *PLAN_CODES.values(), *ROS_CODES.values(), *WORKSPACE_CODES.values()
)
"""Every code of the core: a backend's own are in its attribute `codes`."""


def page_rows(codes: Iterable[Code]) -> list[str]:
    """The rows of the table in `docs/diagnostics.md`. What the language wants, its examples show."""
    return [
        f"| {c.code} | {c.severity} | **{c.title}.** {_cell(c.explanation)} | {_cell(c.remedy) or _EXAMPLE} |"
        for c in codes
    ]


_EXAMPLE = "[see the example](language.md#every-code)"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
