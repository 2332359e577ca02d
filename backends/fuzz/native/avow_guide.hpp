// The contract as a guide: which parts of its formulas hold, in long doubles, tells libFuzzer which runs are new. It
// judges nothing: every run that is kept is judged elsewhere, exactly.
#pragma once

#include <cmath>

#include "avow_made.hpp"

namespace avow {

struct Said {
  bool known;
  long double value;
};

class Guide {
 public:
  Guide(const Values& in, const Values& out) : in_(in), out_(out) {}

  Said of(int at) {
    if (at < 0 || --budget_ < 0) return {false, 0};
    const Part& part = PARTS[at];
    switch (part.op) {
      case Op::number: return {true, part.value};
      case Op::input: return scalar(in_, INPUTS[part.a]);
      case Op::output: return scalar(out_, OUTPUTS[part.a]);
      case Op::bound: return {true, bound_[part.a % 8]};
      case Op::widen: return of(part.a);
      case Op::negate: { Said s = of(part.a); return {s.known, -s.value}; }
      case Op::no: { Said s = of(part.a); return {s.known, s.value == 0 ? 1.0L : 0.0L}; }
      case Op::plus: case Op::minus: case Op::times: case Op::divide: return computed(part);
      case Op::less: case Op::at_most: case Op::greater: case Op::at_least: case Op::equal: case Op::other:
        return compared(at, part);
      case Op::both: case Op::either: case Op::implies: case Op::same: return joined(part);
      case Op::choose: { Said s = of(part.a); return s.known ? of(s.value != 0 ? part.b : part.c) : s; }
      case Op::index_input: return item(in_, INPUTS[part.a], of(part.b));
      case Op::index_output: return item(out_, OUTPUTS[part.a], of(part.b));
      case Op::length_input: return length(in_, INPUTS[part.a]);
      case Op::length_output: return length(out_, OUTPUTS[part.a]);
      case Op::every: case Op::some: return quantified(part);
      case Op::unknown: break;
    }
    return {false, 0};
  }

  // What libFuzzer looks at.
  void mark(std::size_t at) { marks[at % sizeof marks] = 1; }
  static std::uint8_t marks[8192];
  std::uint64_t pattern = 1469598103934665603ULL;

 private:
  static const Value* found(const Values& values, const Port& port) {
    auto held = values.all().find(port.name);
    if (held == values.all().end() || held->second.sort != port.sort || held->second.many != port.many) return nullptr;
    return &held->second;
  }

  static Said one(const Value& value, const Port& port, std::size_t at) {
    switch (port.sort) {
      case Sort::real: return at < value.reals.size() ? Said{true, value.reals[at]} : Said{false, 0};
      case Sort::element:
        for (std::size_t k = 0; at < value.elements.size() && k < port.members; ++k)
          if (value.elements[at] == port.elements[k]) return {true, (long double)k};
        return {false, 0};
      default: return at < value.integers.size() ? Said{true, (long double)value.integers[at]} : Said{false, 0};
    }
  }

  static Said scalar(const Values& values, const Port& port) {
    const Value* value = found(values, port);
    return value == nullptr || port.many ? Said{false, 0} : one(*value, port, 0);
  }

  static Said item(const Values& values, const Port& port, Said at) {
    const Value* value = found(values, port);
    if (value == nullptr || !at.known || at.value < 0 || at.value > 1e6L) return {false, 0};
    return one(*value, port, std::size_t(at.value));
  }

  static Said length(const Values& values, const Port& port) {
    const Value* value = found(values, port);
    if (value == nullptr) return {false, 0};
    return {true, (long double)(value->reals.size() + value->integers.size() + value->elements.size())};
  }

  Said computed(const Part& part) {
    Said l = of(part.a), r = of(part.b);
    bool known = l.known && r.known;
    switch (part.op) {
      case Op::plus: return {known, l.value + r.value};
      case Op::minus: return {known, l.value - r.value};
      case Op::times: return {known, l.value * r.value};
      default: return {known && r.value != 0, r.value != 0 ? l.value / r.value : 0};
    }
  }

  Said compared(int at, const Part& part) {
    Said l = of(part.a), r = of(part.b);
    if (!l.known || !r.known) return {false, 0};
    long double gap = l.value - r.value;
    long double size = std::fabs(l.value) + std::fabs(r.value) + 1e-300L;
    int near = gap == 0 ? 0 : std::fabs(gap) < size * 1e-15L ? 1 : std::fabs(gap) < size * 1e-3L ? 2 : 3;
    mark(std::size_t(at) * 8 + std::size_t(gap < 0 ? 4 : 0) + std::size_t(near));
    bool holds = false;
    switch (part.op) {
      case Op::less: holds = gap < 0; break;
      case Op::at_most: holds = gap <= 0; break;
      case Op::greater: holds = gap > 0; break;
      case Op::at_least: holds = gap >= 0; break;
      case Op::equal: holds = gap == 0; break;
      default: holds = gap != 0;
    }
    pattern = (pattern ^ std::uint64_t(at * 2 + holds)) * 1099511628211ULL;
    return {true, holds ? 1.0L : 0.0L};
  }

  Said joined(const Part& part) {
    Said l = of(part.a), r = of(part.b);
    bool known = l.known && r.known;
    bool p = l.value != 0, q = r.value != 0;
    switch (part.op) {
      case Op::both:
        if ((l.known && !p) || (r.known && !q)) return {true, 0};
        return {known, 1};
      case Op::either:
        if ((l.known && p) || (r.known && q)) return {true, 1};
        return {known, 0};
      case Op::implies:
        if ((l.known && !p) || (r.known && q)) return {true, 1};
        return {known, 0};
      default: return {known, p == q ? 1.0L : 0.0L};
    }
  }

  // Over whole numbers from 0 on: what runs through the places of a sequence.
  Said quantified(const Part& part) {
    bool every = part.op == Op::every, known = true;
    long double held = bound_[part.b % 8];
    for (int k = 0; k < 64; ++k) {
      bound_[part.b % 8] = k;
      Said s = of(part.a);
      known = known && s.known;
      if (s.known && (s.value != 0) != every) {
        bound_[part.b % 8] = held;
        return {true, every ? 0.0L : 1.0L};
      }
    }
    bound_[part.b % 8] = held;
    return {known, every ? 1.0L : 0.0L};
  }

  const Values& in_;
  const Values& out_;
  long double bound_[8] = {};
  int budget_ = 20000;
};

// Whether the assumptions seem to hold; what cannot be told does not stand against it.
inline bool allowed(const Values& in) {
  Outputs none;
  Guide guide(in, none);
  bool all = true;
  for (std::size_t k = 0; k < ASSUMPTION_COUNT; ++k) {
    Said said = guide.of(ASSUMPTIONS[k]);
    all = all && !(said.known && said.value == 0);
  }
  return all;
}

}  // namespace avow
