// How the contract's names meet the radiation sensor in C++, for the method `fuzz`.
#include "avow_node.hpp"
#include "radiation_sensor.hpp"

struct AvowNode {
  rover::RadiationSensor sensor;

  explicit AvowNode(const avow::Parameters& given)
      : sensor(given.real("orange"), given.real("red"), int(given.integer("dwell"))) {}

  void step(const avow::Inputs& in, avow::Outputs& out) {
    out.element("radiationStatus", sensor.status(in.real("r")));
  }
};
