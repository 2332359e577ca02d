// The agent in Dafny: a second implementation, after the Gwendolen program, held against the same contract (the
// paper's section "Compositionality enables Interchangeability"). Unlike the paper's listing it can be executed: the
// mission map is a table, and the decision is proved for every table. `doit export` writes the file that it includes.
include "../../../artifacts/remote_inspection/agent/dafny/agent_spec.dfy"

module {:options "--function-syntax:3"} AgentImpl refines AgentSpec {
  type Place = (real, real)

  // The mission map (waypoints.csv): waypoint k is at Map()[k]; waypoint 0 is the exit.
  function method Map(): seq<Place>
  {
    [ (-8.18, -3.16), (-4.07, -7.24), (-7.25, -5.26), (-0.49, -3.51), (2.30, -1.93), (5.48, -3.48), (-0.47, -6.52),
      (1.98, -7.88), (5.36, -6.31), (6.80, -5.69), (7.79, -2.67), (1.30, 2.20), (2.94, 8.56) ]
  }

  predicate IsMap(wayP: (real, real, nat) -> bool, places: seq<Place>)
  {
    forall x: real, y: real, i: nat :: wayP(x, y, i) <==> (i < |places| && places[i] == (x, y))
  }

  // The map that the robot is given is that table.
  predicate Env(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat,
                in_inspected: nat -> bool, in_phase: Types.Phase)
  {
    IsMap(in_wayP, Map())
  }

  lemma EnvNotEmpty()
    returns (in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat,
             in_inspected: nat -> bool, in_phase: Types.Phase)
  {
    in_wayP := (x: real, y: real, i: nat) => i < |Map()| && Map()[i] == (x, y);
    in_at := (x: real, y: real) => false;
    in_radiationStatus, in_inspected, in_phase := Types.RadStat.green, (i: nat) => false, Types.Phase.exploring;
    assert Contract.exit_known_ex1(in_wayP, Map()[0].0, Map()[0].1);
  }

  method Step(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat,
              in_inspected: nat -> bool, in_phase: Types.Phase)
    returns (out_command: Types.CommandSet, out_phase: Types.Phase)
  {
    out_command, out_phase := Decide(Map(), in_wayP, in_at, in_radiationStatus, in_inspected, in_phase);
  }

  // The decision, for any map.
  method Decide(places: seq<Place>, ghost wayP: (real, real, nat) -> bool, at: (real, real) -> bool,
                status: Types.RadStat, inspected: nat -> bool, phase: Types.Phase)
    returns (command: Types.CommandSet, next: Types.Phase)
    requires 0 < |places| && IsMap(wayP, places)
    requires Contract.one_waypoint(wayP, at)
    ensures Contract.next_waypoint(wayP, at, status, inspected, phase, command)
    ensures Contract.inspect_here(wayP, at, status, inspected, phase, command)
    ensures Contract.exit_on_danger(wayP, status, phase, command)
    ensures Contract.abandon(status, phase, next)
    ensures Contract.end_of_mission(wayP, at, status, inspected, phase, next)
  {
    var exit := places[0];
    if status != Types.RadStat.green || phase == Types.Phase.leaving {
      command, next := Types.CommandSet.move(exit.0, exit.1), Types.Phase.leaving;
      assert Contract.exit_on_danger_ex1(wayP, command, exit.0, exit.1);
      return;
    }
    next := Types.Phase.exploring;
    var here := Find(places, at);
    if here == |places| {
      // Under way: to the first place that is still to be inspected.
      var k := 0;
      while k < |places| && inspected(k)
      {
        k := k + 1;
      }
      var goal := if k < |places| then places[k] else exit;
      command := Types.CommandSet.move(goal.0, goal.1);
      return;
    }
    OnlyHere(places, wayP, at, here);
    if !inspected(here) {
      command := Types.CommandSet.inspect(here);
    } else if here + 1 < |places| {
      var goal := places[here + 1];
      command := Types.CommandSet.move(goal.0, goal.1);
      assert Contract.next_waypoint_ex2(wayP, command, here, goal.0, goal.1);
      assert Contract.end_of_mission_ex2(wayP, here, goal.0, goal.1);
    } else {
      command, next := Types.CommandSet.move(exit.0, exit.1), Types.Phase.leaving;
      assert Contract.next_waypoint_ex2(wayP, command, here, exit.0, exit.1);
      assert Contract.end_of_mission_ex1(wayP, at, inspected, places[here].0, places[here].1, here);
    }
  }

  // The waypoint at which the robot is; |places| if it is at none.
  method Find(places: seq<Place>, at: (real, real) -> bool) returns (here: nat)
    ensures here <= |places|
    ensures here < |places| ==> at(places[here].0, places[here].1)
    ensures forall k: nat :: k < here ==> !at(places[k].0, places[k].1)
  {
    here := 0;
    while here < |places| && !at(places[here].0, places[here].1)
      invariant here <= |places|
      invariant forall k: nat :: k < here ==> !at(places[k].0, places[k].1)
    {
      here := here + 1;
    }
  }

  // A robot at waypoint `here` is at no other.
  lemma OnlyHere(places: seq<Place>, wayP: (real, real, nat) -> bool, at: (real, real) -> bool, here: nat)
    requires IsMap(wayP, places) && Contract.one_waypoint(wayP, at)
    requires here < |places| && at(places[here].0, places[here].1)
    ensures forall x: real, y: real, i: nat :: at(x, y) && wayP(x, y, i) ==> i == here
  {
    forall x: real, y: real, i: nat | at(x, y) && wayP(x, y, i)
      ensures i == here
    {
      assert Contract.one_waypoint_all1(wayP, at, x, y, places[here].0, places[here].1, i, here);
    }
  }
}
