// A node made with its parameters, and what its values look like to Avow.
#pragma once

#include <type_traits>

#include "avow_tables.hpp"
#include "contract.inc"

namespace avow {

inline Parameters parameters() {
  Parameters made;
  for (std::size_t k = 0; k < PARAMETER_COUNT; ++k) {
    const Parameter& given = PARAMETERS[k];
    Value value;
    value.sort = given.sort;
    if (given.sort == Sort::real) value.reals = {given.real};
    else if (given.sort == Sort::element) value.elements = {given.text};
    else value.integers = {given.integer};
    made.put(given.name, std::move(value));
  }
  return made;
}

// The node of an adapter; one that takes no parameters needs no constructor.
template <class Node>
inline Node made() {
  if constexpr (std::is_constructible_v<Node, const Parameters&>) return Node(parameters());
  else return Node();
}

// Memory that a node says it has; nothing where the contract has none.
template <class Node>
inline void remembered(const Node& node, Outputs& out) {
#if AVOW_MEMORY
  node.memory(out);
#else
  (void)node;
  (void)out;
#endif
}

}  // namespace avow
