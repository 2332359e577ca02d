// The harness that libFuzzer drives: a run from bytes, step after step, where the assumptions seem to hold.
#include <cstdio>
#include <cstdlib>
#include <unistd.h>

#include "avow_drawn.hpp"
#include "avow_guide.hpp"

__attribute__((section("__libfuzzer_extra_counters"))) std::uint8_t avow::Guide::marks[8192];

#include ADAPTER

namespace {

long long runs = 0;
char nonce[64] = "";
int channel = -1;
bool within = false;  // the node's own code runs

void closing() {
  char line[160];
  int size = std::snprintf(line, sizeof line, "%s %s %lld\n", nonce, within ? "left" : "done", runs);
  if (channel >= 0 && size > 0 && write(channel, line, std::size_t(size)) < 0) _exit(1);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* said = std::getenv("AVOW_CHANNEL");
  if (said != nullptr) {
    channel = std::atoi(said);
    std::size_t size = 0;
    char byte;
    // the nonce comes first through the same pipe's other half, so that no environment holds it
    const char* from = std::getenv("AVOW_NONCE");
    int source = from != nullptr ? std::atoi(from) : -1;
    while (source >= 0 && size + 1 < sizeof nonce && read(source, &byte, 1) == 1 && byte != '\n') nonce[size++] = byte;
    if (source >= 0) close(source);
    unsetenv("AVOW_CHANNEL");
    unsetenv("AVOW_NONCE");
    std::atexit(closing);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ++runs;
  avow::Run run(data, size);
  within = true;
  AvowNode node = avow::made<AvowNode>();
  within = false;
  avow::Inputs in, given;
  while (run.next()) {
    avow::Outputs before;
    within = true;
    avow::remembered(node, before);
    within = false;
    for (std::size_t p = 0; p < avow::INPUT_COUNT; ++p) {
      const avow::Port& port = avow::INPUTS[p];
      if (port.held) {
        auto held = before.all().find(port.name);
        if (held != before.all().end()) in.put(port.name, held->second);
        continue;
      }
      avow::Value value = run.value(port, in);
      in.put(port.name, value);
      given.put(port.name, std::move(value));
    }
    avow::Outputs out;
    if (!avow::allowed(in)) continue;
    within = true;
    node.step(given, out);
    avow::Outputs after;
    avow::remembered(node, after);
    within = false;
    for (const auto& held : after.all()) out.put(held.first, held.second);
    for (std::size_t g = 0; g < avow::GUARANTEE_COUNT; ++g) {
      avow::Guide guide(in, out);
      avow::Said said = guide.of(avow::GUARANTEES[g]);
      guide.mark(4096 + std::size_t(guide.pattern % 3072));
      if (said.known && said.value == 0) guide.mark(7168 + g % 512);
    }
  }
  return 0;
}
