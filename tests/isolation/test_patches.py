"""A subject whose step is wrong and that wants to seem right: what comes back is what the step returned, or nothing."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.isolation.level import SANDBOX
from avow.isolation.observed import Seen
from avow.isolation.subject import SubjectFailed, SubjectProcess

STEP = "\ndef step(wish):\n    return wish\n"
HOST = "import sys\nhost = sys.modules['__main__']\n"
RIGHT = "{'q': ['0', '1']}"
"""What the contract asks for, where the step returns a thousand."""

PATCHES = {
    "what answers": HOST + f"host.answer = lambda *a: {{'value': {RIGHT}}}" + STEP,
    "what codes": HOST + f"host.coded = lambda *a: {RIGHT}" + STEP,
    "what codes, for a moment": HOST
    + f"coded = host.coded\ndef fake(*a):\n    host.coded = coded\n    return {RIGHT}\n"
    "def step(wish):\n    host.coded = fake\n    return wish\n",
    "what codes, as it returns": HOST + f"class C:\n    def __del__(self):\n        host.coded = lambda *a: {RIGHT}\n"
    "def step(wish):\n    c = C()\n    return wish\n",
    "what codes, in a thread": HOST + "import threading, time\ndef on():\n    while True:\n"
    f"        host.coded = lambda *a: {RIGHT}\nthreading.Thread(target=on, daemon=True).start()" + STEP,
    "what codes, by a codec": HOST + "import codecs\ndef search(name):\n"
    f"    host.coded = lambda *a: {RIGHT}\ncodecs.register(search)\ntry:\n    ''.encode('x')\n"
    "except LookupError:\n    pass" + STEP,
    "what codes, by a pickle": "import pickle\nclass P:\n    def __reduce__(self):\n        return exec, ("
    f"\"import sys; sys.modules['__main__'].coded = lambda *a: {RIGHT}\",)\npickle.loads(pickle.dumps(P()))" + STEP,
    "what codes, by its module": HOST
    + "import types\nclass M(types.ModuleType):\n    def __getattribute__(self, name):\n"
    f"        return lambda *a: {RIGHT}\nhost.__class__ = M" + STEP,
    "what codes, by its loader": f"type(__loader__).get_code.__globals__['coded'] = lambda *a: {RIGHT}" + STEP,
    "what codes, by a function's cells": "import os, random, time\ndef look(f, deep=0):\n"
    f"    getattr(f, '__globals__', {{}}).update(coded=lambda *a: {RIGHT})\n"
    "    for c in (getattr(f, '__closure__', None) or ()) if deep < 6 else ():\n"
    "        look(c.cell_contents, deep + 1)\n"
    "for f in (os.stat, os.open, time.time, random.seed, os.getcwd):\n    look(f)" + STEP,
    "what is sent": HOST + "host.plain = lambda *a: 0\nhost.loads = lambda *a: [{'wish': 0}]" + STEP,
    "json's reader": "import json\njson.loads = lambda *a, **k: [{'wish': 0}]\n"
    "json.decoder.JSONDecoder.decode = lambda *a, **k: [{'wish': 0}]" + STEP,
    "json's writer": 'import json\nright = \'{"replies": [{"value": 0}], "seen": []}\'\n'
    "json.dumps = lambda *a, **k: right\njson.JSONEncoder.encode = lambda *a: right" + STEP,
    "fractions": "import fractions\nF = fractions.Fraction\nF.as_integer_ratio = lambda s: (0, 1)\n"
    "F.numerator = F._numerator = property(lambda s: 0)\nF.denominator = property(lambda s: 1)" + STEP,
    "fractions as they are made": "import fractions\nfractions.Fraction.__new__ = lambda c, *a, **k: 0" + STEP,
    "builtin functions": "import builtins\nbuiltins.isinstance = lambda *a: False\nbuiltins.str = lambda *a: '0'\n"
    "builtins.int = lambda *a: 0\nbuiltins.type = lambda *a: float" + STEP,
    "a number of its own": "from fractions import Fraction\nclass L(Fraction):\n    numerator = denominator = 0\n"
    "    def as_integer_ratio(self): return 0, 1\ndef step(wish):\n    return L(wish)\n",
    "a float of its own": "class L(float):\n    def as_integer_ratio(self): return 0, 1\n"
    "    def __float__(self): return 0.0\n"
    "def step(wish):\n    return L(wish)\n",
    "a whole number of its own": "class L(int):\n    def __int__(self): return 0\n"
    "    __index__ = __str__ = __repr__ = __int__\n"
    "def step(wish):\n    return L(wish)\n",
    "what says that it is a float": "class L:\n    __class__ = float\n    def as_integer_ratio(self): return 0, 1\n"
    "def step(wish):\n    return L()\n",
    "what is traced": "import sys\ndef trace(frame, event, a):\n    if frame.f_code.co_name == 'coded':\n"
    "        frame.f_locals['value'] = 0\n    return trace\nsys.settrace(trace)" + STEP,
    "what watches": "import os\ntype(os.stat('/'))._looked.__globals__['asked'] = 0" + STEP,
    "the stream of answers": "import io, os\nos.write = lambda d, b: len(b)\nio.TextIOWrapper = None" + STEP,
}
FRAMES = {
    "a generator's": "def walk():\n    yield FOUND(gen.gi_frame)\ndef step(wish):\n    global gen\n    gen = walk()\n"
    "    next(gen)\n    return wish\n",
    "a signal's": "import signal\nsignal.signal(10, lambda number, frame: FOUND(frame))\ndef step(wish):\n"
    "    signal.raise_signal(10)\n    return wish\n",
    "the log's": "import logging\ndef step(wish):\n    FOUND(logging.currentframe())\n    return wish\n",
    "a profile's": "import sys\nsys.setprofile(lambda frame, event, a: FOUND(frame))" + STEP,
    "one of the library's name": "import os\nHERE = {'FOUND': FOUND}\nexec(compile('import sys\\ndef f():\\n"
    "    FOUND(sys._getframe())', os.__file__, 'exec'), HERE)\ndef step(wish):\n    HERE['f']()\n    return wish\n",
    "one of the library's name, in bytes": "import os\nHERE = {'FOUND': FOUND}\nexec(compile(b'import sys\\ndef f():\\n"
    "    FOUND(sys._getframe())', os.__file__, 'exec'), HERE)\ndef step(wish):\n    HERE['f']()\n    return wish\n",
    "one that gets the library's name": "import os, sys\ndef f():\n    FOUND(sys._getframe())\n"
    "f.__code__ = f.__code__.replace(co_filename=os.__file__)\ndef step(wish):\n    f()\n    return wish\n",
    "one of a name of its own kind": "class N(str):\n    startswith = removeprefix = lambda *a: True\n"
    "HERE = {'FOUND': FOUND}\nexec(compile('import sys\\ndef f():\\n    FOUND(sys._getframe())', N('/x'), 'exec'),"
    " HERE)\ndef step(wish):\n    HERE['f']()\n    return wish\n",
    "its own": "import sys\ndef step(wish):\n    FOUND(sys._getframe())\n    return wish\n",
    "an error's": "def step(wish):\n    try:\n        1 / 0\n    except ZeroDivisionError as error:\n"
    "        FOUND(error.__traceback__.tb_frame)\n    return wish\n",
}
FOUND = f"""
import sys
def FOUND(frame):
    while frame is not None:
        if 'coded' in frame.f_globals and frame.f_globals is not vars(sys.modules['__main__']):
            frame.f_globals['coded'] = lambda *a: {RIGHT}
        for noted in frame.f_locals.values():
            if type(noted) in (list, set) and noted and type(next(iter(noted))) in (list, tuple):
                noted.clear()
        frame = frame.f_back
"""


def asked(folder: Path, text: str, times: int = 30) -> tuple[list[Any], SubjectProcess]:
    (folder / "s.py").write_text(text)
    subject = SubjectProcess(folder / "s.py", "step", 20.0, folder)
    try:
        replies = [reply for _ in range(2) for reply in subject.ask_all([{"wish": {"q": [1000, 1]}}] * times)]
    finally:
        subject.close()
    return replies, subject


@pytest.mark.parametrize("name", some(PATCHES, 3, 10))
def test_what_is_patched_answers_nothing(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    replies, subject = asked(tmp_path, PATCHES[name])
    whole = all(isinstance(reply, SubjectFailed) or reply.get("q") != ["0", "1"] for reply in replies)
    outside = any(seen.kind is Seen.OUTSIDE for seen in subject.observed())
    assert whole or outside or subject.fault, replies
    if (
        name == "what watches"
        or "host.coded" in PATCHES[name]
        or "'coded'] =" in PATCHES[name]
        or "host.answer" in PATCHES[name]
    ):
        assert subject.fault == "the subject patches what runs it"


@pytest.mark.parametrize("name", some(FRAMES, 2))
def test_who_looks_at_frames_is_told(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    replies, subject = asked(tmp_path, FOUND + FRAMES[name])
    right = any(not isinstance(reply, SubjectFailed) and reply.get("q") == ["0", "1"] for reply in replies)
    told = any(seen.kind is Seen.OUTSIDE and seen.path == "what runs it" for seen in subject.observed())
    assert (told or subject.fault) if name != "a signal's" else not right
    assert told or subject.fault or not right


CELLS = "[cell.cell_contents for cell in {}.__closure__]"
WAYS_AROUND = {
    "the clock's own function": "time.time.__wrapped__()",
    "what the clock's function holds": f"[found for found in {CELLS.format('time.time')} "
    "if type(found).__name__.startswith('builtin')][0]()",
    "what was noted": f"time.time(); [found.clear() for found in {CELLS.format('os.stat(__file__)._told')} "
    "if type(found) in (list, set)]",
    "what a stream holds": "fcntl.ioctl(1, 0x541B, b'0000')",
}


@pytest.mark.parametrize("name", some(WAYS_AROUND, 2, slow=2))
def test_a_way_around_what_watches_is_closed_or_told(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    text = f"import fcntl, os, time\ndef step(wish):\n    {WAYS_AROUND[name]}\n    return wish\n"
    replies, subject = asked(tmp_path, text, times=1)
    told = any(seen.kind is Seen.OUTSIDE for seen in subject.observed())
    assert told or isinstance(replies[0], SubjectFailed)


HONEST = {
    "a method of JSON": "import json\njson.JSONEncoder.default = lambda self, o: str(o)" + STEP,
    "another print": "import builtins\nbuiltins.print = lambda *a, **k: None" + STEP,
    "a name in the main module": HOST + "host.version = 3" + STEP,
    "a float of its own": "class F(float):\n    pass\ndef step(wish):\n    return F(wish)\n",
    "a decimal number": "from decimal import Decimal\ndef step(wish):\n    return Decimal(wish.numerator)\n",
    "a thread that ends": "import threading, time\ndef step(wish):\n"
    "    threading.Thread(target=time.sleep, args=(0.05,)).start()\n    return wish\n",
    "a thread of a service": "import threading, time\n"
    "threading.Thread(target=time.sleep, args=(60,), daemon=True).start()" + STEP,
    "an idle pool": "from concurrent.futures import ThreadPoolExecutor as T\npool = T(2)\npool.submit(len, ())" + STEP,
    "a handler of signals": "import signal\nsignal.signal(2, lambda *a: None)\nsignal.signal(15, signal.SIG_IGN)"
    + STEP,
    "streams that are closed": "import os\nos.closerange(0, 3)" + STEP,
    "streams that lead nowhere": "import os\nd = os.open(os.devnull, os.O_WRONLY)\nos.dup2(d, 1)\nos.dup2(d, 2)" + STEP,
    "many open files": "import os\nkept = [os.open(os.devnull, 0) for _ in range(200)]" + STEP,
    "a log in its scratch": "import tempfile\nwith tempfile.TemporaryFile() as f:\n    f.write(b'x' * 1_000_000)"
    + STEP,
}


@pytest.mark.parametrize("name", some(HONEST, 2, slow=1))
def test_what_only_concerns_itself_is_judged(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    replies, subject = asked(tmp_path, HONEST[name], times=2)
    assert [reply["q"] for reply in replies] == [["1000", "1"]] * 4
    assert (subject.fault, subject.silent) == ("", "")


THREAD = "import threading, time\nthreading.Thread(target=time.sleep, args=(60,)).start()\n"
ENDS = """import os, threading as t
n = 0
def step(wish):
    global n
    n += 1
    if n == 4:  # the last, behind which it is asked to end
        t.Timer(0.3, os._exit, (0,)).start()
    return wish
"""
DEEDS = {
    "a thread that is left": (THREAD + STEP, "left threads running"),
    "one that is hidden": (THREAD + "threading._active.clear()" + STEP, "left threads running"),
    "one of no class": (
        "import _thread, time\nbegun = _thread.allocate_lock()\nbegun.acquire()\ndef run():\n    begun.release()\n"
        "    time.sleep(60)\n_thread.start_new_thread(run, ())\nbegun.acquire()" + STEP,
        "left threads",
    ),
    "a pool at work": (
        "import time\nfrom concurrent.futures import ThreadPoolExecutor as T\npool = T(2)\npool.submit(time.sleep, 60)"
        + STEP,
        "left threads running",
    ),
    "an end in a thread": (ENDS, "left threads running|does not end as it is asked"),
    "a disk that it fills": (
        "import tempfile\nkept = open(tempfile.gettempdir() + '/x', 'wb')\nkept.write(b'x' * 2_000_000)\nkept.flush()"
        + STEP,
        "fills its scratch folder",
    ),
}


@pytest.mark.parametrize("name", some(DEEDS, 1, slow=1))
def test_what_it_leaves_is_an_error(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    monkeypatch.setattr("avow.isolation.subject.SCRATCH_BYTES", 1_000_000)
    text, fault = DEEDS[name]
    _, subject = asked(tmp_path, text, times=2)
    assert re.search(fault, subject.fault), subject.silent
