// The plain program: makes a node, gives it what it is told, and says what came of it. It judges nothing.
//
//   replay FROM TO MARK     lines come through descriptor FROM, answers go through TO
//
// A line is `TURN COMMAND...`: `N` makes a node, `S VALUE...` is a step with the inputs that are no memory, in order,
// which is left out where the assumptions seem not to hold. `D BYTES` asks for the inputs that the harness draws of
// these bytes (hexadecimal); nothing of the node is run.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dirent.h>
#include <exception>
#include <iostream>
#ifdef AVOW_FILLED
#include <malloc.h>
#endif
#include <memory>
#include <pthread.h>
#include <sstream>
#include <unistd.h>

#include "avow_drawn.hpp"
#include "avow_guide.hpp"

std::uint8_t avow::Guide::marks[8192];

#include ADAPTER

namespace {

// Before any constructor of the node's file.
void begun(int, char**, char**) {
#ifdef AVOW_FILLED
  mallopt(M_PERTURB, 0xa5);
#endif
}
__attribute__((section(".preinit_array"), used)) void (*const first)(int, char**, char**) = begun;

void quoted(std::string& text, const std::string& value) {
  text += '"';
  for (unsigned char c : value) {
    char code[8];
    if (c < 0x20 || c > 0x7e || c == '"' || c == '\\') {
      std::snprintf(code, sizeof code, "\\u%04x", c);
      text += code;
    } else {
      text += char(c);
    }
  }
  text += '"';
}

void one(std::string& text, const avow::Value& value, std::size_t at) {
  char number[64];
  switch (value.sort) {
    case avow::Sort::real:
      std::snprintf(number, sizeof number, "{\"f\": \"%a\"}", value.reals.at(at));
      text += number;
      break;
    case avow::Sort::integer:
      std::snprintf(number, sizeof number, "{\"i\": \"%lld\"}", (long long)value.integers.at(at));
      text += number;
      break;
    case avow::Sort::truth: text += value.integers.at(at) != 0 ? "true" : "false"; break;
    case avow::Sort::element: quoted(text, value.elements.at(at)); break;
  }
}

void told(std::string& text, const avow::Value& value) {
  if (!value.many) return one(text, value, 0);
  text += "{\"l\": [";
  std::size_t count = value.reals.size() + value.integers.size() + value.elements.size();
  for (std::size_t k = 0; k < count; ++k) {
    if (k != 0) text += ", ";
    one(text, value, k);
  }
  text += "]}";
}

std::string object(const avow::Values& values) {
  std::string text = "{";
  for (const auto& held : values.all()) {
    if (text.size() > 1) text += ", ";
    quoted(text, held.first);
    text += ": ";
    told(text, held.second);
  }
  return text + "}";
}

std::string pairs(const avow::Values& values) {
  std::string text = "{\"d\": [";
  bool more = false;
  for (const auto& held : values.all()) {
    text += more ? ", [" : "[";
    more = true;
    quoted(text, held.first);
    text += ", ";
    told(text, held.second);
    text += "]";
  }
  return text + "]}";
}

avow::Value given(const avow::Port& port, std::istringstream& words) {
  avow::Value value;
  value.sort = port.sort;
  value.many = port.many;
  std::size_t count = 1;
  std::string word;
  if (port.many) {
    words >> word;
    count = std::strtoull(word.c_str(), nullptr, 10);
  }
  for (std::size_t k = 0; k < count; ++k) {
    words >> word;
    switch (port.sort) {
      case avow::Sort::real: value.reals.push_back(std::strtod(word.c_str(), nullptr)); break;
      case avow::Sort::element:
        value.elements.push_back(port.elements[std::strtoull(word.c_str(), nullptr, 10) % port.members]);
        break;
      default: value.integers.push_back(std::strtoll(word.c_str(), nullptr, 10));
    }
  }
  return value;
}

std::string why(const char* kind, const char* name, const char* what) {
  std::string text = "{\"";
  text += kind;
  text += "\": ";
  quoted(text, name);
  text += ", \"why\": ";
  quoted(text, std::string(name) + ": " + std::string(what).substr(0, 300));
  return text + "}";
}

std::string drawn(std::istringstream& words) {
  std::string hex;
  words >> hex;
  std::vector<std::uint8_t> data;
  for (std::size_t k = 0; k + 1 < hex.size(); k += 2)
    data.push_back(std::uint8_t(std::strtoul(hex.substr(k, 2).c_str(), nullptr, 16)));
  std::string text = "[";
  avow::Values last;
  avow::Run run(data.data(), data.size());
  while (run.next()) {
    for (std::size_t p = 0; p < avow::INPUT_COUNT; ++p)
      if (!avow::INPUTS[p].held) last.put(avow::INPUTS[p].name, run.value(avow::INPUTS[p], last));
    text += (text.size() > 1 ? ", " : "") + object(last);
  }
  return text + "]";
}

std::unique_ptr<AvowNode> node;

std::string answered(std::istringstream& words) {
  std::string command, text;
  words >> command;
  if (command == "D") return drawn(words);
  try {
    if (command == "N" || !node) {
      node.reset();
      node.reset(new AvowNode(avow::made<AvowNode>()));
    }
    avow::Outputs before, out, after;
    avow::remembered(*node, before);
    if (command == "N") return "{\"held\": " + object(before) + "}";
    avow::Inputs in;
    avow::Values all = before;
    for (std::size_t p = 0; p < avow::INPUT_COUNT; ++p) {
      if (avow::INPUTS[p].held) continue;
      avow::Value value = given(avow::INPUTS[p], words);
      all.put(avow::INPUTS[p].name, value);
      in.put(avow::INPUTS[p].name, std::move(value));
    }
    if (!avow::allowed(all)) return "{\"skipped\": true, \"before\": " + object(before) + "}";
    node->step(in, out);
    avow::remembered(*node, after);
    return "{\"before\": " + object(before) + ", \"value\": " + pairs(out) + ", \"memory\": " + object(after) + "}";
  } catch (const avow::Misuse& error) {
    return why("misuse", "the adapter", error.what());
  } catch (const std::exception& error) {
    return why("error", "std::exception", error.what());
  } catch (...) {
    return why("error", "an exception", "it is no std::exception");
  }
}

void say(int to, const std::string& text) {
  std::size_t at = 0;
  while (at < text.size()) {
    ssize_t some = write(to, text.data() + at, text.size() - at);
    if (some < 0 && errno != EINTR) _exit(1);
    if (some > 0) at += std::size_t(some);
  }
}

}  // namespace

int main(int count, char** words) {
  if (count < 3) return 2;
  int from = std::atoi(words[1]), to = std::atoi(words[2]);
  FILE* lines = fdopen(from, "r");
  if (lines == nullptr) return 2;
  say(to, "{\"ready\": true}\n");
  char* line = nullptr;
  std::size_t room = 0;
  while (getline(&line, &room, lines) > 0) {
    std::istringstream turns{std::string(line)};
    std::string turn, part, text;
    std::getline(turns, turn, '|');
    bool more = false;
    while (std::getline(turns, part, '|')) {
      std::istringstream each(part);
      text += (more ? ", " : "") + std::string("{\"value\": ") + answered(each) + "}";
      more = true;
    }
    std::cout.flush();
    std::fflush(nullptr);
    say(to, "{\"turn\": \"" + turn + "\", \"replies\": [" + text + "]}\n");
  }
  say(to, "{\"end\": true}\n");
  _exit(0);
}
