// The radiation sensor of radiation_sensor.py, in C++: what a reading means, and which waypoints have been inspected.
//
//     g++ -O1 radiation_sensor.cpp -o radiation_sensor $(pkg-config --cflags --libs roscpp)
//
// Its private parameters are those of the Python node: ~orange, ~red, ~dwell.

#include <ros/ros.h>

#include <cstdint>
#include <memory>
#include <string>

#include "radiation_sensor.hpp"

namespace rover {

struct Snapshot {  // msg/gazebo_radiation_plugins/msg/Snapshot.msg
  std::string command;
  double posX = 0;
  double posY = 0;
  std::uint32_t id = 0;
  double radiation = 0;
  std::string level;
  std::string phase;
};

}  // namespace rover

namespace ros {
namespace message_traits {

template <> struct IsMessage<rover::Snapshot> : TrueType {};

template <> struct DataType<rover::Snapshot> {
  static const char* value() { return "gazebo_radiation_plugins/Snapshot"; }
  static const char* value(const rover::Snapshot&) { return value(); }
};

template <> struct MD5Sum<rover::Snapshot> {
  static const char* value() { return "e0621033c2f336160b208de09235cf12"; }
  static const char* value(const rover::Snapshot&) { return value(); }
};

template <> struct Definition<rover::Snapshot> {
  static const char* value() {
    return "string command\nfloat64 posX\nfloat64 posY\nuint32 id\nfloat64 radiation\nstring level\nstring phase\n";
  }
  static const char* value(const rover::Snapshot&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <> struct Serializer<rover::Snapshot> {
  template <typename Stream, typename Message> static void allInOne(Stream& stream, Message message) {
    stream.next(message.command);
    stream.next(message.posX);
    stream.next(message.posY);
    stream.next(message.id);
    stream.next(message.radiation);
    stream.next(message.level);
    stream.next(message.phase);
  }
  ROS_DECLARE_ALLINONE_SERIALIZER
};

}  // namespace serialization
}  // namespace ros

class RadiationSensor {
 public:
  RadiationSensor() {
    ros::NodeHandle own("~");
    sensor_ = std::make_unique<rover::RadiationSensor>(
        own.param("orange", 120.0), own.param("red", 250.0), own.param("dwell", 5));
    inspected_ = node_.advertise<rover::Snapshot>("/inspected", 100, true);
    status_ = node_.advertise<rover::Snapshot>("/radiationStatus", 100, true);
    command_ = node_.subscribe("/command", 100, &RadiationSensor::commanded, this);
    reading_ = node_.subscribe("/r", 100, &RadiationSensor::step, this);
  }

 private:
  void commanded(const boost::shared_ptr<rover::Snapshot const>& message) { latest_ = *message; }

  void step(const boost::shared_ptr<rover::Snapshot const>& reading) {
    if (auto ended = sensor_->inspected(latest_.command == "inspect", latest_.id)) {
      rover::Snapshot inspected;
      inspected.id = *ended;
      inspected_.publish(inspected);
    }
    rover::Snapshot status;
    status.level = sensor_->status(reading->radiation);
    status_.publish(status);
  }

  ros::NodeHandle node_;
  ros::Publisher inspected_, status_;
  ros::Subscriber command_, reading_;
  rover::Snapshot latest_;
  std::unique_ptr<rover::RadiationSensor> sensor_;
};

int main(int argc, char** argv) {
  ros::init(argc, argv, "radiationSensor");
  RadiationSensor sensor;
  ros::spin();
}
