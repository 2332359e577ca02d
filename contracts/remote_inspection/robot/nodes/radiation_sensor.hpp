// The radiation sensor's step, without ROS: what a reading means, and which waypoints have been inspected. The ROS node
// (radiation_sensor.cpp) runs this class; the method `fuzz` of the plan looks at it.
#pragma once

#include <cstdint>
#include <optional>
#include <set>

namespace rover {

class RadiationSensor {
 public:
  RadiationSensor(double orange, double red, int dwell) : orange_(orange), red_(red), dwell_(dwell) {}

  const char* status(double reading) const { return reading < orange_ ? "green" : reading < red_ ? "orange" : "red"; }

  // At each reading: the waypoint of an inspection that has just ended.
  std::optional<std::uint32_t> inspected(bool inspecting, std::uint32_t id) {
    readings_ = inspecting ? readings_ + 1 : 0;
    if (readings_ >= dwell_ && done_.insert(id).second) return id;
    return std::nullopt;
  }

 private:
  double orange_, red_;
  int dwell_, readings_ = 0;
  std::set<std::uint32_t> done_;
};

}  // namespace rover
