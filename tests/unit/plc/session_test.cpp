#include "plc/session.hpp"

#include <gtest/gtest.h>

#include "plc/registers.hpp"

namespace binpick::plc {
namespace {
using namespace std::chrono_literals;

/// A Modbus client of few words, its frames written by hand.
struct Rig {
  Session session;
  TimePoint now{1s};
  std::array<std::uint16_t, kRequestLength> block{};

  explicit Rig(const Options& options) : session{options, 7} {
    EXPECT_TRUE(session.on_accept(1, "127.0.0.1", 40000, now));
    session.set_not_ready(0, now);
  }

  Bytes exchange(ConnectionId id, const Bytes& frame) {
    session.on_bytes(id, frame, now);
    return session.take_output(id);
  }
  void write() {
    Bytes frame{std::byte{0},  std::byte{9}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{23}, std::byte{255},
                std::byte{16}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{8}, std::byte{16}};
    for (const auto word : block) append_be(frame, word);
    const Bytes answer = exchange(1, frame);
    EXPECT_EQ(answer, (Bytes{std::byte{0}, std::byte{9}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{6},
                             std::byte{255}, std::byte{16}, std::byte{0}, std::byte{0}, std::byte{0}, std::byte{8}}));
  }
  void control(std::uint16_t bits) {
    block[at("control")] = bits;
    write();
  }
  std::uint16_t word(std::string_view name) const {
    for (const auto& r : kRegisters)
      if (r.name == name) return session.register_at(r.offset);
    ADD_FAILURE() << name;
    return 0;
  }
  std::uint16_t status() const { return word("status"); }
};

Options options() {
  Options o;
  o.part_ids = {1, 2};
  o.supply_ids = {1};
  return o;
}
}  // namespace

TEST(Session, OnePick) {
  Rig rig{options()};
  EXPECT_EQ(rig.status(), status::kReady);
  rig.control(0);
  rig.block[at("sequence")] = 5;
  rig.block[at("part_id")] = 2;
  rig.block[at("supply_id")] = 1;
  rig.control(control::kRequest | control::kRobotClear);
  EXPECT_EQ(rig.status(), status::kAck | status::kBusy);
  EXPECT_EQ(rig.word("ack_sequence"), 5);
  ASSERT_TRUE(std::holds_alternative<RobotClearChanged>(*rig.session.take_event()));
  const auto event = rig.session.take_event();
  ASSERT_TRUE(std::holds_alternative<RequestAccepted>(*event));
  EXPECT_EQ(std::get<RequestAccepted>(*event).request.part_id, 2);
  rig.control(control::kRobotClear);
  EXPECT_EQ(rig.status(), status::kBusy);
  rig.session.on_scan_done(rig.now);
  EXPECT_EQ(rig.status(), status::kBusy | status::kScanDone);
  PickResult result;
  result.code = ResultCode::PickFound;
  result.pick_id = 3;
  result.part_id = 2;
  rig.session.publish(result, rig.now);
  EXPECT_EQ(rig.status(), status::kResultValid | status::kScanDone);
  EXPECT_EQ(rig.word("result_sequence"), 5);
  EXPECT_EQ(rig.word("result_sequence_tail"), 5);
  rig.block[at("result_ack")] = 5;
  rig.write();
  EXPECT_EQ(rig.status(), status::kReady | status::kScanDone);
  EXPECT_EQ(rig.word("result_sequence"), 0);
}
}  // namespace binpick::plc
