"""Plans for the case study, as texts: the tests' own, so that they do not follow the shipped ones."""

REPAIRED = """\
system: remote_inspection
contract: system.rcl
ros: {nodes: {navigation: {remap: {currentLoc: position}}}}
connections:
  - {from: agent.command, to: [navigation.command, radiationSensor.command], delayed: true,
     initial: "exists(x, y in REAL | out.command == move(x, y))"}
  - {from: agent.phase, to: agent.phase, delayed: true, initial: exploring}
  - {from: navigation.at, to: navigation.last, delayed: true,
     initial: "exists(a, b in REAL | forall(x, y in REAL | out.at(x, y) <=> (x == a and y == b)))"}
  - {from: radiationSensor.inspected, to: radiationSensor.before, delayed: true,
     initial: "forall(i in NATURAL | not out.inspected(i))"}
environment:
  in.wayP:
    assume: >-
      exists(x, y in REAL | in.wayP(x, y, 0)) and
      forall(x, y, x', y' in REAL, i, j in NATURAL |
        (in.wayP(x, y, i) and in.wayP(x', y', j) and -0.5 <= x - x' <= 0.5 and -0.5 <= y - y' <= 0.5) -> i == j)
    because: the mission map is loaded and checked before start
  in.r: {assume: "0 <= in.r", because: the counter counts}
  in.sensors: {because: hardware}
compose:
  D1: {select: [navigation, radiationSensor, agent], rule: R3}
  position: {select: [localisation, agent, navigation], rule: R3}
  line: {select: [localisation, navigation], rule: R1}
"""

PUBLISHED = """\
system: remote_inspection_published
contract: system.rcl
ros: {nodes: {navigation: {remap: {currentLoc: position}}}}
compose:
  D1: {select: [navigation, radiationSensor, agent], rule: R3, persistence: {because: "topics are latched"}}
"""

SCENARIO = """\
scenario:
  waypoints: waypoints.csv
  interpret: {in.wayP: "waypoints(x, y, id)"}
  domains: {NATURAL: waypoints.id, in.r: [30, 130]}
requirements:
  REQ1: {text: "The robot should inspect each waypoint", supported_by: [agent]}
  REQ3:
    text: dangerous radiation ends the mission
    formula: "radiationSensor.radiationStatus in {red, orange} -> agent.phase == leaving"
    supported_by: [agent.abandon]
  REQ4:
    text: eventually all inspected, or the mission ended
    temporal: "eventually (forall(i in NATURAL | radiationSensor.inspected(i)) or agent.phase == leaving)"
  TOO_MUCH:
    text: danger or not, all is inspected
    temporal: "eventually forall(i in NATURAL | radiationSensor.inspected(i))"
  STAYS_ENDED:
    text: what is ended stays ended
    temporal: "always (agent.phase == leaving -> next agent.phase == leaving)"
"""

PUBLISHED_DELAYED = """\
system: remote_inspection_published
contract: system.rcl
ros: {nodes: {navigation: {remap: {currentLoc: position}}}}
connections:
  - {from: agent.command, to: [navigation.command, radiationSensor.command], delayed: true,
     initial: "exists(x, y in REAL | out.command == move(x, y))"}
scenario:
  waypoints: waypoints.csv
  interpret: {in.wayP: "waypoints(x, y, id)"}
  domains: {NATURAL: waypoints.id, in.r: [30]}
requirements:
  REQ4: {text: eventually all inspected, temporal: "eventually forall(i in NATURAL | radiationSensor.inspected(i))"}
"""
