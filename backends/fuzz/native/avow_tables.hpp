// The shapes of what is generated from a contract (`contract.inc`): tables of numbers and escaped texts, no code.
#pragma once

#include <cstddef>
#include <cstdint>

#include "avow_node.hpp"

namespace avow {

struct Port {
  const char* name;
  Sort sort;
  bool many;
  bool natural;
  bool held;  // memory: the adapter says it
  const char* const* elements;
  std::size_t members;
};

struct Parameter {
  const char* name;
  Sort sort;
  double real;
  std::int64_t integer;
  const char* text;
};

// A formula as a tree in an array; `a`, `b`, `c` are places of its parts.
enum class Op : unsigned char {
  number, input, output, bound, widen, negate, plus, minus, times, divide,
  less, at_most, greater, at_least, equal, other, no, both, either, implies, same, choose,
  index_input, index_output, length_input, length_output, every, some, unknown
};

struct Part {
  Op op;
  int a, b, c;
  double value;
};

}  // namespace avow
