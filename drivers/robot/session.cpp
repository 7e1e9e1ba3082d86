#include "drivers/robot/session.hpp"

#include <deque>

#include "base/log.hpp"
#include "drivers/robot/codec.hpp"

namespace binpick::drivers::robot {
namespace {
/// Answers waiting to be sent; a robot waits for each answer, so more means that nobody reads them.
constexpr std::size_t kUnreadBytesMax = 16 * 1024;
}  // namespace

struct Session::Impl {
  explicit Impl(const Options& o) : options{o} {}

  Options options;
  bool connected = false;
  bool reopen = false;
  TimePoint heard_at;
  LineReader lines;
  Bytes output;
  std::deque<Event> events;
  std::uint64_t bad_lines = 0;
  bool bad_line_logged = false;  // on this connection

  // What is on record belongs to the cell, not to a connection: a robot that reconnects finds it again.
  std::optional<Pick> offered;
  NoPick reason = NoPick::NotReady;
  std::uint16_t fetched_id = 0;  // sent to the robot and not reported yet, 0: none
  std::uint16_t reported_id = 0;
  Outcome outcome = Outcome::None;

  struct Path {
    std::uint16_t scan, number;
    bool begun = false, may_go = false;
  };
  std::optional<Path> path;         // that the robot is to run, or runs
  std::uint16_t path_ended_id = 0;  // the last one that came to its end: its report may come twice

  /// With it goes what the robot said of it and nobody has heard yet: it would count for the next one.
  void forget_path() {
    path.reset();
    std::erase_if(events, [](const Event& event) {
      return std::holds_alternative<PathBegun>(event) || std::holds_alternative<PathEnded>(event) ||
             std::holds_alternative<PathBroken>(event);
    });
  }

  Reply reply(Status status) const { return {status, {}, reported_id, outcome}; }

  Reply answer(const Request& request) {
    if (request.is_report()) return take_report(request);
    if (request.kind == Request::Kind::Hello) {
      // The id of the open pick lets a program that was restarted know where it was.
      Reply hello = reply(Status::Hello);
      hello.pick.pick_id = offered ? offered->pick_id : fetched_id;
      return hello;
    }
    if (request.is_of_scan()) return on_path(request);
    if (path) {
      Reply scan = reply(Status::Scan);
      scan.pick.pick_id = path->scan;
      scan.pick.part_id = path->number;
      return scan;
    }
    if (!offered) return reply(static_cast<Status>(reason));
    fetched_id = offered->pick_id;
    events.push_back(Fetched{offered->pick_id});
    Reply pick = reply(Status::Pick);
    pick.pick = *offered;
    return pick;
  }

  Reply take_report(const Request& report) {
    const bool done = report.kind == Request::Kind::Done;
    const bool is_offered = offered && offered->pick_id == report.pick_id;
    const bool is_open = is_offered || (fetched_id != 0 && fetched_id == report.pick_id);
    if (is_open) {
      reported_id = report.pick_id;
      outcome = done ? Outcome::Done : Outcome::Failed;
      if (fetched_id == report.pick_id) fetched_id = 0;
      if (is_offered) {
        offered.reset();
        reason = NoPick::NotReady;
      }
      events.push_back(Reported{report.pick_id, done});
    } else if (report.pick_id != reported_id) {
      // Not open, and not a repetition of the last report: a pick of before a restart of the cell, say.
      Reply unknown = reply(Status::UnknownPick);
      unknown.pick.pick_id = report.pick_id;
      return unknown;
    }
    Reply taken = reply(Status::ReportTaken);  // a repetition is answered by the outcome that stands
    taken.pick.pick_id = report.pick_id;
    return taken;
  }

  Reply on_path(const Request& said) {
    const bool is_wanted = path && path->scan == said.pick_id;
    const bool again = said.kind == Request::Kind::End && said.pick_id == path_ended_id;
    Reply answer = reply(again ? Status::ReportTaken : Status::UnknownScan);
    answer.pick.pick_id = said.pick_id;
    if (!is_wanted) return answer;
    if (said.kind == Request::Kind::Begin) {
      if (!std::exchange(path->begun, true)) events.push_back(PathBegun{});
      answer.status = path->may_go ? Status::Go : Status::NotReady;
      return answer;
    }
    // An end without a beginning, or before it was let go, is none: nothing was measured.
    const bool ended = said.kind == Request::Kind::End && path->may_go;
    if (ended) path_ended_id = path->scan;
    path.reset();
    if (ended)
      events.push_back(PathEnded{});
    else
      events.push_back(PathBroken{});
    answer.status = Status::ReportTaken;
    return answer;
  }

  void on_line(const Expected<std::string, BadLine>& line) {
    const auto request = line ? decode_request(*line) : Expected<Request, BadLine>{tl::unexpect, line.error()};
    if (!request) {
      ++bad_lines;
      if (!bad_line_logged)
        BINPICK_LOG(Warning, "robot", "request not understood: %s; compare the robot's program with its manual page",
                    to_string(request.error()).c_str());
      bad_line_logged = true;
    }
    append(output, as_bytes(encode(request ? answer(*request) : reply(Status::BadRequest), options.dialect)));
  }

  void lose(const std::string& text) {
    connected = false;
    lines.clear();
    output.clear();
    events.push_back(Lost{text});
  }
};

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

void Session::on_connected(TimePoint now) {
  impl_->connected = true;
  impl_->reopen = false;
  impl_->heard_at = now;
  impl_->lines.clear();
  impl_->output.clear();
  impl_->bad_line_logged = false;
  impl_->events.push_back(Connected{});
}

void Session::on_bytes(ByteView bytes, TimePoint now) {
  if (!impl_->connected) return;
  impl_->heard_at = now;
  impl_->lines.push(bytes);
  while (const auto line = impl_->lines.next()) {
    impl_->on_line(*line);
    if (impl_->output.size() <= kUnreadBytesMax) continue;
    impl_->lose("it sends requests without reading the answers");
    impl_->reopen = true;
    return;
  }
}

void Session::on_disconnected(TimePoint) {
  if (impl_->connected) impl_->lose("connection closed");
}

void Session::on_deadline(TimePoint now) {
  const auto due = deadline();
  if (!due || now < *due) return;
  impl_->lose("silent for " + std::to_string(impl_->options.silence_max.count()) + " s");
  impl_->reopen = true;
}

std::optional<TimePoint> Session::deadline() const {
  if (!impl_->connected) return std::nullopt;
  return impl_->heard_at + impl_->options.silence_max;
}

Bytes Session::take_output() { return std::exchange(impl_->output, {}); }

std::optional<Event> Session::take_event() {
  if (impl_->events.empty()) return std::nullopt;
  Event event = std::move(impl_->events.front());
  impl_->events.pop_front();
  return event;
}

bool Session::take_reopen() { return std::exchange(impl_->reopen, false); }
bool Session::connected() const { return impl_->connected; }
std::uint64_t Session::bad_lines() const { return impl_->bad_lines; }

void Session::offer(const Pick& pick) {
  impl_->offered = pick;
  impl_->fetched_id = 0;
  if (impl_->reported_id == pick.pick_id) {  // ids come round after 65535
    impl_->reported_id = 0;
    impl_->outcome = Outcome::None;
  }
}

void Session::ask_path(std::uint16_t scan, std::uint16_t path) {
  impl_->path = Impl::Path{.scan = scan, .number = path};
  if (impl_->path_ended_id == scan) impl_->path_ended_id = 0;  // numbers come round after 65535
}

void Session::let_go() {
  if (impl_->path) impl_->path->may_go = true;
}

void Session::forget_path() { impl_->forget_path(); }

void Session::withdraw(NoPick reason) {
  impl_->offered.reset();
  impl_->reason = reason;
}
}  // namespace binpick::drivers::robot
