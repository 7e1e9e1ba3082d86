#include "bench/production/fault_figures.hpp"

#include <algorithm>
#include <cstdio>
#include <string_view>
#include <utility>

namespace binpick::bench {
namespace {
bool ends_well(const RequestRecord& r) { return r.answer == "pick" || (r.answer == "empty" && r.left_before == 0); }

template <class... Values>
std::string text(const char* format, Values... values) {
  std::array<char, 300> line{};
  std::snprintf(line.data(), line.size(), format, values...);
  return line.data();
}

std::string words_of(const FaultRecord& fault) {
  return text("%s %s for %.2f s while %s", fault.device.c_str(), fault.name.c_str(), fault.lasted_s,
              fault.phase.c_str());
}

std::size_t index_of(std::string_view phase) {
  const auto at = std::ranges::find(support::kCyclePhases, phase,
                                    [](support::CyclePhase p) { return std::string_view{to_text(p)}; });
  return static_cast<std::size_t>(at - support::kCyclePhases.begin());
}
}  // namespace

int FaultFigures::wrong_from_fault() const {
  return static_cast<int>(std::ranges::count_if(wrong, &WrongAtFault::is_from_fault));
}

FaultFigures fault_figures_of(const std::vector<std::string>& names, const std::vector<PartRun>& runs) {
  FaultFigures f;
  std::vector<double> recovered;
  for (std::size_t part = 0; part < runs.size(); ++part) {
    const RequestRecord* before = nullptr;
    for (const RequestRecord& r : runs[part].requests) {
      ++f.requests;
      f.available += ends_well(r);
      const RequestRecord* last = std::exchange(before, &r);
      if (last != nullptr && last->bin != r.bin) last = nullptr;
      if (r.fault && !r.fault->reached) ++f.not_reached;
      const bool faulted = r.fault && r.fault->reached;
      const bool after = last != nullptr && last->fault && last->fault->reached;
      if (after && !ends_well(*last) && ends_well(r)) ++f.asked_again;
      if (faulted) {
        ++f.faults;
        const std::size_t phase = index_of(r.fault->phase);
        if (phase < support::kCyclePhases.size()) ++f.injected[r.fault->device].at(phase);
        ++f.answers[r.answer];
        recovered.push_back(r.fault->recovered_s);
        if (r.fault->handshake_lost)
          f.lost_handshakes.push_back(text("%s, bin %llu, request %d: %s", names[part].c_str(),
                                           static_cast<unsigned long long>(r.bin), r.request,
                                           words_of(*r.fault).c_str()));
      }
      const bool sent = r.answer == "pick";
      const bool is_wrong = (sent && r.wrong) || r.closed_wrong;
      if (!faulted && !after) {
        f.others += sent;
        f.others_wrong += is_wrong;
        continue;
      }
      f.looked_at += sent;
      const bool false_empty = r.answer == "empty" && r.left_before > 0;
      if (!is_wrong && !false_empty) continue;
      const std::string which = faulted ? words_of(*r.fault) : "the request before: " + words_of(*last->fault);
      f.wrong.push_back({names[part], is_wrong ? "wrong pose" : "\"empty\" with objects left", which, r.bin, r.request,
                         r.error_mm, r.error_deg, r.cause != "scene"});
    }
  }
  if (!recovered.empty()) f.recovered_max_s = std::ranges::max(recovered);
  f.recovered_s = spread(std::move(recovered));
  return f;
}

std::string to_table(const FaultFigures& f) {
  std::string out = "| faults |";
  for (const auto phase : support::kCyclePhases) out += std::string{" "} + to_text(phase) + " |";
  out += "\n|---|---|---|---|---|---|---|\n";
  for (const auto& [device, counts] : f.injected) {
    out += "| " + device + " |";
    for (const int count : counts) out += text(" %d |", count);
    out += "\n";
  }
  out += text("\n%d faults in %d requests", f.faults, f.requests);
  if (f.not_reached > 0) out += text(" (%d more found no such phase in their request)", f.not_reached);
  out += ". Answers to the faulted requests:";
  for (const auto& [answer, count] : f.answers) out += text(" %s %d;", answer.c_str(), count);
  out += text("\nPoses sent at a fault or right after it: %d; at all others %d, %d of them wrong.\n", f.looked_at,
              f.others, f.others_wrong);
  for (const WrongAtFault& w : f.wrong)
    out += text("- %s, bin %llu, request %d: %s, %.1f mm %.1f deg, %s (%s)\n", w.part.c_str(),
                static_cast<unsigned long long>(w.bin), w.request, w.what.c_str(), w.error_mm, w.error_deg,
                w.is_from_fault ? "NOT seen without the fault" : "the same without the fault", w.fault.c_str());
  for (const std::string& lost : f.lost_handshakes) out += "- handshake lost: " + lost + "\n";
  out += "\n| | here | must | |\n|---|---|---|---|\n";
  out += text("| wrong poses and false \"empty\" from a fault | %d | 0 | %s |\n", f.wrong_from_fault(),
              f.wrong_from_fault() == 0 ? "must reached" : "MISSED");
  out += text("| lost handshakes | %zu | 0 | %s |\n", f.lost_handshakes.size(),
              f.lost_handshakes.empty() ? "must reached" : "MISSED");
  out += text("| availability %%, each request by its own answer | %.2f | | |\n", f.availability_percent());
  out += text("| availability %%, where the PLC asked again after a fault by that | %.2f | | |\n",
              f.with_asking_again_percent());
  out += text("| recovery s p50 / p95 / longest | %.2f / %.2f / %.2f | | |\n", f.recovered_s.p50, f.recovered_s.p95,
              f.recovered_max_s);
  return out;
}
}  // namespace binpick::bench
