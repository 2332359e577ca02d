// Inputs of a run drawn from bytes: mostly numbers at which something may change, and what lies beside them or beside
// earlier inputs. The same bytes are the same run.
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "avow_made.hpp"

namespace avow {

class Drawn {
 public:
  Drawn(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::uint64_t take(int bytes) {
    std::uint64_t value = 0;
    for (int k = 0; k < bytes; ++k) value = value << 8 | (at_ < size_ ? data_[at_] : 0), ++at_;
    return value;
  }

  bool left() const { return at_ < size_; }

  Value value(const Port& port, const Value* before) {
    if (before != nullptr && take(1) % 4 == 1) return *before;
    Value made;
    made.sort = port.sort;
    made.many = port.many;
    std::size_t count = 1;
    if (port.many) count = take(1) % 4 == 3 ? LENGTHS[take(1) % LENGTH_COUNT] : take(1) % 6;
    for (std::size_t k = 0; k < count; ++k) {
      switch (port.sort) {
        case Sort::real: made.reals.push_back(real()); break;
        case Sort::integer: made.integers.push_back(integer(port.natural)); break;
        case Sort::truth: made.integers.push_back(std::int64_t(take(1) & 1)); break;
        case Sort::element: made.elements.push_back(port.elements[take(1) % port.members]); break;
      }
    }
    return made;
  }

 private:
  double real() {
    double made = 0;
    std::uint64_t way = take(1) % 8;
    switch (way) {
      case 3: made = seen(); break;
      case 4: made = seen() + REALS[take(1) % REAL_COUNT]; made = beside(made); break;
      case 5: made = beside(REALS[take(1) % REAL_COUNT]); break;
      case 6: made = double(std::int16_t(std::uint16_t(take(2)))) / 8.0; break;
      case 7: {
        std::uint64_t bits = take(8);
        std::memcpy(&made, &bits, sizeof made);
        break;
      }
      default: made = REALS[take(1) % REAL_COUNT];
    }
    if (AVOW_FLOAT32) made = double(float(made));
    if (!std::isfinite(made)) made = 0;
    reals_[reals_count_++ % 16] = made;
    return made;
  }

  double beside(double made) {
    std::uint64_t way = take(1) % 3;
    if (way == 0) return made;
    double infinity = std::numeric_limits<double>::infinity();
    if (AVOW_FLOAT32) return double(std::nextafter(float(made), float(way == 1 ? infinity : -infinity)));
    return std::nextafter(made, way == 1 ? infinity : -infinity);
  }

  double seen() {
    std::uint64_t which = take(1);
    std::uint64_t known = reals_count_ < 16 ? reals_count_ : 16;
    return known == 0 ? 0.0 : reals_[which % known];
  }

  std::int64_t integer(bool natural) {
    std::int64_t made = 0;
    switch (take(1) % 8) {
      case 4: made = std::int64_t(std::uint64_t(last_) + take(1) % 5 - 2); break;
      case 5: made = std::int16_t(std::uint16_t(take(2))); break;
      case 6: made = std::int64_t(take(8)); break;
      case 7: made = ENDS[take(1) % END_COUNT]; break;
      default: made = INTEGERS[take(1) % INTEGER_COUNT];
    }
    if (natural && made < 0) made = made == std::numeric_limits<std::int64_t>::min() ? 0 : -made;
    last_ = made;
    return made;
  }

  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
  double reals_[16] = {};
  std::uint64_t reals_count_ = 0;
  std::int64_t last_ = 0;
};

// The steps of a run.
class Run {
 public:
  Run(const std::uint8_t* data, std::size_t size) : drawn_(data, size), steps_(1 + int(drawn_.take(1) % AVOW_STEPS)) {}

  // Whether there is another step.
  bool next() {
    bool more = at_ < steps_ && (at_ == 0 || drawn_.left());
    ++at_;
    return more;
  }

  Value value(const Port& port, const Values& before) {
    auto last = before.all().find(port.name);
    return drawn_.value(port, last == before.all().end() ? nullptr : &last->second);
  }

 private:
  Drawn drawn_;
  int steps_, at_ = 0;
};

}  // namespace avow
