"""Nodes in C++, for rclcpp and roscpp: read by their words, without a compiler.

A call is read as far as its arguments are literals, or names that the file defines once as literals. Macros are not
expanded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import field
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.ros.code.created import Code, Created, is_harmless
from avow.ros.quality import LEVELS, PROFILES, SYSTEM, Quality, quality, seconds

_CALLS = {
    "rclcpp_action::create_server": ("does", 1, None),
    "rclcpp_action::create_client": ("orders", 1, None),
    "create_publisher": ("publishes", 0, 1),
    "create_subscription": ("subscribes", 0, 1),
    "create_service": ("serves", 0, None),
    "create_client": ("calls", 0, None),
    "declare_parameter": ("declares", 0, None),
    "advertise": ("publishes", 0, None),
    "subscribe": ("subscribes", 0, None),
    "advertiseService": ("serves", 0, None),
    "serviceClient": ("calls", 0, None),
}
"""What a function creates, and which of its arguments are the name and the quality of service."""
_ROS1 = ("advertise", "subscribe", "advertiseService", "serviceClient")
_CALL = re.compile(rf"(?<![\w:])({'|'.join(_CALLS)})\s*(?=[<(])")
_OTHERS = re.compile(
    r"(?<![\w:])(?!rclcpp_action)\w[\w:]*::create_\w+|\bmessage_filters::Subscriber\b|#\s*define\b.*\bcreate_"
)
"""What creates ends, too, and is not read."""
_TRANSFORMS = re.compile(r"\b(Static)?Transform(Listener|Broadcaster)\b")
_SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|R"\((.*?)\)"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.S)
_TEXT = re.compile(r'\s*(?:std::string\s*[({]\s*)?"((?:\\.|[^"\\])*)"\s*[)}]?\s*\Z')
_TYPE = re.compile(r"\s*(?:::)?(\w+)(?:::(?:msg|srv|action))?::(\w+)\s*\Z")
_UNIT = {"nanoseconds": "ns", "microseconds": "us", "milliseconds": "ms", "seconds": "s", "minutes": "min"}
_BRANCH = re.compile(r"\b(?:if|for|while|switch|else|catch)\b[^;{}]*\Z|\b(?:try|else)\s*\Z")


def from_cxx(text: str, file: str, beside: Collection[str] = ()) -> Code:
    """`beside`: the names of files that are read too. Never raises."""
    return _Reader(file, _SKIPPED.sub(_blank, text), beside).read()


def _blank(found: re.Match[str]) -> str:
    """Comments as blanks: every place remains what it is."""
    return found[0] if not found[0].startswith("/") else re.sub(r"[^\n]", " ", found[0])


@dataclass(slots=True)
class _Reader:
    file: str
    code: str
    """Without comments."""
    beside: Collection[str] = ()
    created: list[Created] = field(default_factory=list)
    unread: list[tuple[str, Span]] = field(default_factory=list)

    def read(self) -> Code:
        for found in re.finditer(r"^[ \t]*#[ \t]*include[ \t]*([<\"])([^>\"\n]*)", self.code, re.M):
            if Path(found[2]).name not in self.beside and not (
                is_harmless(found[2]) or ("/" not in found[2] and found[1] == "<")
            ):
                self.tell(found.start(), f"{found[2]} is not read")
        for found in _OTHERS.finditer(self.code):
            self.tell(found.start(), f"`{found[0]}` is not read")
        for found in _TRANSFORMS.finditer(self.code):
            names = ("/tf_static",) if found[1] else ("/tf", "/tf_static") if found[2] == "Listener" else ("/tf",)
            side, span = "subscribes" if found[2] == "Listener" else "publishes", self.at(found.start())
            self.created += [Created(side, name, "tf2_msgs/TFMessage", span, sure=False) for name in names]
        own = re.findall(r"\bNodeHandle\s+\w+\s*(?:[({]([^(){};]*)[)}])?\s*[;,)]", self.code)
        for found in _CALL.finditer(self.code):
            side, at, quality_at = _CALLS[found[1]]
            kind, begin = self.template(found.end())
            arguments = self.arguments(begin)
            if arguments is None or len(arguments) <= at:
                continue  # a declaration, or a name of something else
            name = self.word(arguments[at])
            if name is None or (found[1] in _ROS1 and not name.startswith("/") and any(own)):
                self.tell(found.start(), f"the name `{' '.join(arguments[at].split())[:60]}` is computed")
                continue
            made = Quality()
            if quality_at is not None and len(arguments) > quality_at:
                made = self.quality(arguments[quality_at], found.start())
            elif found[1] == "advertise" and len(arguments) == 3:
                made = Quality(durability="transient_local" if arguments[2].strip() == "true" else None)
            self.created.append(
                Created(side, name, self.kind(kind), self.at(found.start()), made, self.sure(found.start()))
            )
        return Code(tuple(self.created), tuple(self.unread))

    def template(self, at: int) -> tuple[str, int]:
        """The argument of a template, and where it ends."""
        if not self.code.startswith("<", at):
            return "", at
        depth = 0
        for place in range(at, len(self.code)):
            depth += {"<": 1, ">": -1}.get(self.code[place], 0)
            if not depth:
                return self.code[at + 1 : place], place + 1
        return "", len(self.code)

    def arguments(self, at: int) -> list[str] | None:
        """The texts between the commas of a call; None if there is no call."""
        begin = re.compile(r"\s*\(").match(self.code, at)
        if begin is None:
            return None
        parts, depth, start = [], 0, begin.end()
        for found in re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|[()\[\]{},]').finditer(self.code, start):
            sign = found[0]
            if sign in ("(", "[", "{"):
                depth += 1
            elif sign in (")", "]", "}"):
                depth -= 1
            if depth < 0 or (depth == 0 and sign == ","):
                parts.append(self.code[start : found.start()])
                start = found.end()
            if depth < 0:
                return parts if any(part.strip() for part in parts) else []
        return None

    def sure(self, at: int) -> bool:
        """Whether no condition is around a place, in its function."""
        depth, place = 0, at
        while (place := max(self.code.rfind("{", 0, place), self.code.rfind("}", 0, place))) >= 0:
            depth += 1 if self.code[place] == "}" else -1
            if depth < 0:
                depth = 0
                if _BRANCH.search(self.code, max(0, place - 200), place):
                    return False
        return not _BRANCH.search(self.code, max(0, at - 200), at)

    # -- values --------------------------------------------------------------------------------------------------------

    def defined(self, name: str) -> tuple[str, int] | None:
        """The text with which the file defines a name, and its place, if it does so once."""
        if not re.fullmatch(r"\s*[\w:]+\s*", name):
            return None
        last = re.escape(name.strip().rpartition("::")[2])
        kind = r"(?<![\w:])(?!return\b)([\w:]+)(?:<[^;<>]*>)?(?:\s*+[&*]\s*+|\s++)(?:const\s++)?"
        found = [*re.finditer(rf"{kind}{last}\s*+(?:\[\])?\s*+(=(?!=)|[({{])", self.code)]
        assigned = re.findall(rf"(?<![\w.>]){last}\s*+=(?!=)", self.code)
        if len(found) != 1 or len(assigned) > (found[0][2] == "="):
            return None
        ((made, sign),), end = [each.groups() for each in found], self.code.find(";", found[0].end())
        value = self.code[found[0].end() : end].strip()
        return value if sign == "=" else f"{made}{sign}{value}", end

    def word(self, text: str) -> str | None:
        found = _TEXT.match(text)
        if found is None and (defined := self.defined(text)) is not None:
            value = re.sub(r"\A[\w:]*\s*[({]\s*(.*?)\s*[)}]\Z", r"\1", defined[0], flags=re.S)
            found = _TEXT.match(value)
        return found[1] if found is not None else None

    def kind(self, text: str) -> str:
        """``std_msgs/Float64``; empty if it is not known."""
        if (alias := re.search(rf"\busing\s+{re.escape(text.strip())}\s*=\s*([^;]+);", self.code)) is not None:
            text = alias[1]
        elif (named := re.search(rf"\busing\s+([\w:]+::{re.escape(text.strip())})\s*;", self.code)) is not None:
            text = named[1]
        found = _TYPE.match(text)
        return f"{found[1]}/{found[2]}" if found is not None else ""

    def quality(self, text: str, user: int) -> Quality:
        """The policies that are known."""
        name, after = text.strip(), ""
        if (defined := self.defined(text)) is not None:
            text = defined[0]
            changes = [*re.finditer(rf"(?<![\w.]){re.escape(name)}\s*\.([^;]+);", self.code)]
            if any(not defined[1] < c.start() < user or not self.sure(c.start()) for c in changes):
                return Quality()
            after = "".join(f".{c[1]}" for c in changes)
        chain = self.profile(" ".join(text.split()) + after)
        return quality(chain) if chain is not None else Quality()

    def profile(self, text: str) -> dict[str, Any] | None:
        base = re.match(
            r"(?:rclcpp::)?(?:QoS\s*[({]\s*(?:(?:rclcpp::)?KeepLast\s*[({]\s*)?(\d+)\s*\)?\s*[)}]|(\d+)\Z"
            r"|QoS\s*[({]\s*(?:rclcpp::)?KeepAll\s*\(\s*\)\s*[)}]"
            r"|(?:QoS\s*[({]\s*(?:rclcpp::)?QoSInitialization::from_rmw\s*\(\s*)?rmw_qos_profile_(\w+)[^.]*"
            r"|(SensorData|SystemDefaults|Services|Parameters|ParameterEvents|Clock|Rosout|BestAvailable)QoS"
            r"\s*[({][^(){}]*[)}])",
            text,
        )
        if base is None:
            return None
        named = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", base[4] or "").lower() or base[3] or "default"
        named = {"system_defaults": "system_default", "services": "services_default"}.get(named, named)
        made: dict[str, Any] = dict(PROFILES.get(named, {}))
        if depth := base[1] or base[2]:
            made["depth"] = int(depth)
        place = base.end()
        while place < len(text):
            step = re.compile(r"\s*\.\s*(\w+)\s*").match(text, place)
            inner = _Reader(self.file, text).arguments(step.end()) if step is not None else None
            if step is None or inner is None:
                return None
            place = text.index("(", step.end()) + 1 + sum(map(len, inner)) + max(0, len(inner) - 1) + 1
            made |= self.policy(step[1], inner[0] if inner else "")
        return {name: value for name, value in made.items() if value is not None}

    def policy(self, word: str, given: str) -> dict[str, Any]:
        """What a method of rclcpp::QoS sets; None: not known."""
        match word:
            case "reliable" | "best_effort" | "reliability_best_available":
                return {"reliability": word}
            case "transient_local" | "durability_volatile":
                return {"durability": word.removeprefix("durability_")}
            case "keep_last":
                return {"depth": int(given) if given.strip().isdigit() else None}
            case "reliability" | "durability" | "liveliness":
                kind = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", given.strip().rpartition("::")[2]).lower()
                kind = kind.removeprefix(f"rmw_qos_policy_{word}_")
                return {word: kind if kind in (*LEVELS[word], *SYSTEM) else None}
            case "deadline" | "liveliness_lease_duration":
                return {"lease" if word != "deadline" else word: _duration(given)}
            case "keep_all" | "history" | "lifespan" | "avoid_ros_namespace_conventions":
                return {"depth": None} if word in ("keep_all", "history") else {}
            case _:  # it may set any
                return dict.fromkeys((*LEVELS, "deadline", "lease", "depth"))

    def at(self, place: int) -> Span:
        line = self.code.count("\n", 0, place) + 1
        column = place - self.code.rfind("\n", 0, place)
        return Span(self.file, line, column, line, column + 1)

    def tell(self, place: int, message: str) -> None:
        self.unread.append((message, self.at(place)))


def _duration(text: str) -> float | None:
    """The seconds of ``100ms``, ``std::chrono::milliseconds(100)``, ``rclcpp::Duration(1, 0)``, ``….from_seconds(1)``;
    infinite for none."""
    if (found := re.fullmatch(r"\s*(?:std::)?chrono::(\w+)\s*[({]\s*([\d.]+)\s*[)}]\s*", text)) is not None:
        return seconds(f"{found[2]} {_UNIT.get(found[1])}")
    if (known := seconds(text)) is not None:
        return known
    numbers = _numbers(re.fullmatch(r"\s*(?:rclcpp::)?Duration(::from_seconds)?\s*[({]\s*([\d.,\s]+)[)}]\s*", text))
    return None if numbers is None else sum(numbers) or math.inf


def _numbers(found: re.Match[str] | None) -> list[float] | None:
    if found is None:
        return None
    parts = [float(part) for part in found[2].split(",")]
    return parts if found[1] and len(parts) == 1 else [parts[0], parts[1] * 1e-9] if len(parts) == 2 else None
