// The radiation sensor in Dafny, held against its contract. `doit export` writes the file that it includes; then any
// editor opens it, and `dafny verify` (Dafny 2: `dafny /compile:0`) verifies it, as Avow does.
include "../../../artifacts/remote_inspection/radiationSensor/dafny/radiationSensor_spec.dfy"

module {:options "--function-syntax:3"} RadiationSensorImpl refines RadiationSensorSpec {
  // Nothing is assumed beyond the contract.
  predicate Env(in_r: real, in_command: Types.CommandSet, in_before: nat -> bool) { true }

  lemma EnvNotEmpty() returns (in_r: real, in_command: Types.CommandSet, in_before: nat -> bool)
  {
    in_r, in_command, in_before := 0.0, Types.CommandSet.inspect(0), (i: nat) => false;
  }

  method Step(in_r: real, in_command: Types.CommandSet, in_before: nat -> bool)
    returns (out_radiationStatus: Types.RadStat, out_inspected: nat -> bool)
  {
    out_radiationStatus := Classify(in_r);
    match in_command {
      case inspect(here) => out_inspected := (i: nat) => i == here || in_before(i);
      case move(x, y) => out_inspected := in_before;
    }
  }

  method Classify(r: real) returns (status: Types.RadStat)
    ensures r < 120.0 ==> status == Types.RadStat.green
    ensures 120.0 <= r < 250.0 ==> status == Types.RadStat.orange
    ensures 250.0 <= r ==> status == Types.RadStat.red
  {
    if r >= 250.0 {
      status := Types.RadStat.red;
    } else if r >= 120.0 {
      status := Types.RadStat.orange;
    } else {
      status := Types.RadStat.green;
    }
  }
}
