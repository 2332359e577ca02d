// What an adapter header stands on: the values that a step is given and gives, by the names that the contract has.
//
// An adapter includes this file and the node's own, and defines, outside of any namespace,
//
//     struct AvowNode {
//       explicit AvowNode(const avow::Parameters& given);                  // only where it takes the plan's parameters
//       void step(const avow::Inputs& in, avow::Outputs& out);             // one step
//       void memory(avow::Outputs& out) const;                             // where the plan has `memory:`
//     };
//
// A name that the contract does not have, a value of another type, or an output that is not given, is a `Misuse`: a
// fault of the adapter, of which nothing is concluded.
#pragma once

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace avow {

class Misuse : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

enum class Sort : unsigned char { truth, integer, real, element };

// A value, or the items of a sequence.
struct Value {
  Sort sort = Sort::real;
  bool many = false;
  std::vector<double> reals;
  std::vector<std::int64_t> integers;  // also truth values
  std::vector<std::string> elements;
};

class Values {
 public:
  void put(const std::string& name, Value value) { held_[name] = std::move(value); }
  void clear() { held_.clear(); }
  const std::map<std::string, Value>& all() const { return held_; }

 protected:
  const Value& find(const std::string& name, Sort sort, bool many) const {
    auto found = held_.find(name);
    if (found == held_.end()) throw Misuse("there is no `" + name + "`");
    const Value& value = found->second;
    if (value.sort != sort || value.many != many)
      throw Misuse("`" + name + "` is read by " + reader(value.sort, value.many) + ", not by " + reader(sort, many));
    return value;
  }
  static std::string reader(Sort sort, bool many) {
    static const char* const names[] = {"truth", "integer", "real", "element"};
    return names[static_cast<unsigned char>(sort)] + std::string(many ? "s()" : "()");
  }
  std::map<std::string, Value> held_;
};

class Inputs : public Values {
 public:
  double real(const std::string& name) const { return find(name, Sort::real, false).reals[0]; }
  std::int64_t integer(const std::string& name) const { return find(name, Sort::integer, false).integers[0]; }
  bool truth(const std::string& name) const { return find(name, Sort::truth, false).integers[0] != 0; }
  const std::string& element(const std::string& name) const { return find(name, Sort::element, false).elements[0]; }
  const std::vector<double>& reals(const std::string& name) const { return find(name, Sort::real, true).reals; }
  const std::vector<std::int64_t>& integers(const std::string& name) const {
    return find(name, Sort::integer, true).integers;
  }
  std::vector<bool> truths(const std::string& name) const {
    const auto& held = find(name, Sort::truth, true).integers;
    return std::vector<bool>(held.begin(), held.end());
  }
  const std::vector<std::string>& elements(const std::string& name) const {
    return find(name, Sort::element, true).elements;
  }
};

// Numbers, truth values and texts of the YAML file; of a mapping within, `outer.inner`.
class Parameters : public Values {
 public:
  bool has(const std::string& name) const { return held_.count(name) != 0; }
  double real(const std::string& name) const {
    auto found = held_.find(name);
    if (found != held_.end() && found->second.sort == Sort::integer) return double(found->second.integers[0]);
    return find(name, Sort::real, false).reals[0];
  }
  std::int64_t integer(const std::string& name) const { return find(name, Sort::integer, false).integers[0]; }
  bool truth(const std::string& name) const { return find(name, Sort::truth, false).integers[0] != 0; }
  const std::string& text(const std::string& name) const { return find(name, Sort::element, false).elements[0]; }
};

class Outputs : public Values {
 public:
  void real(const std::string& name, double value) { give(name, Sort::real, false).reals = {value}; }
  void integer(const std::string& name, std::int64_t value) { give(name, Sort::integer, false).integers = {value}; }
  void truth(const std::string& name, bool value) { give(name, Sort::truth, false).integers = {value ? 1 : 0}; }
  void element(const std::string& name, const std::string& value) {
    give(name, Sort::element, false).elements = {value};
  }
  void reals(const std::string& name, std::vector<double> value) {
    give(name, Sort::real, true).reals = std::move(value);
  }
  void integers(const std::string& name, std::vector<std::int64_t> value) {
    give(name, Sort::integer, true).integers = std::move(value);
  }
  void truths(const std::string& name, const std::vector<bool>& value) {
    give(name, Sort::truth, true).integers.assign(value.begin(), value.end());
  }
  void elements(const std::string& name, std::vector<std::string> value) {
    give(name, Sort::element, true).elements = std::move(value);
  }

 private:
  Value& give(const std::string& name, Sort sort, bool many) {
    if (held_.count(name) != 0) throw Misuse("`" + name + "` is given twice");
    Value& made = held_[name];
    made.sort = sort;
    made.many = many;
    return made;
  }
};

}  // namespace avow
