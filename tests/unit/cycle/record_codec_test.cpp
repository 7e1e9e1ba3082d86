#include <cmath>
#include <gtest/gtest.h>

#include "base/crc32.hpp"
#include "daemon/cycle/replay.hpp"
#include "tests/unit/cycle/records.hpp"

namespace binpick::daemon {
namespace {
using Kind = RecordError::Kind;

/// Pairs of hexadecimal digits, blanks between them as one likes.
Bytes from_hex(std::string_view text) {
  Bytes bytes;
  std::string digits;
  for (const char c : text)
    if (c != ' ') digits += c;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// `bytes` with another section, whose checksum is right, before the end mark.
Bytes with_section(Bytes bytes, std::string_view name, const Bytes& content) {
  Bytes section;
  append(section, as_bytes(name));
  append_le(section, static_cast<std::uint32_t>(content.size()));
  append(section, content);
  append_le(section, crc32(section));
  bytes.insert(bytes.end() - 12, section.begin(), section.end());
  return bytes;
}

TEST(Crc32, IsTheOneOfEthernet) {
  EXPECT_EQ(crc32(as_bytes("123456789")), 0xCBF43926U);
  EXPECT_EQ(crc32({}), 0U);
}

// Written from docs/records.md; the checksums are zlib's.
TEST(RecordCodec, ASmallRecordByteByByte) {
  const Bytes file = from_hex(
      "42 49 4E 50 49 43 4B 52  01 00 00 00"     // BINPICKR, format version
      "6F 72 69 67  1B 00 00 00"                 // orig, 27 bytes
      "05 00 00 00 30 2E 31 2E 30"               // binpick 0.1.0
      "07 00  2A 00 00 00 00 00 00 00"           // start 7, cycle 42
      "7B 68 E5 CF 8B 01 00 00"                  // 2023-11-14 22:13:20.123
      "36 62 5F F3"                              //
      "63 65 6C 6C  1A 00 00 00"                 // cell, 26 bytes
      "06 00 00 00 63 2E 74 6F 6D 6C"            // c.toml
      "04 00 00 00 61 3D 31 0A"                  // a=1
      "00 00 00 00  00 00 00 00"                 // no part files, no knowledge bases
      "17 12 82 C1"                              //
      "73 63 61 6E  53 00 00 00"                 // scan, 83 bytes
      "00 2F 68 59 00 00 00 00"                  // took 1.5 s
      "01 00 00 00 00 00 00 00"                  // profiles: one,
      "00 00 00 00 00 00 00 00"                  // none without a pose,
      "03 00 00 00 00 00 00 00"                  // three lost
      "01 00 00 00  2B 00 00 00"                 // one follows, 43 bytes
      "A0 BB 0D 00 00 00 00 00"                  // measured at 0.9 ms,
      "40 42 0F 00 00 00 00 00"                  // received at 1 ms
      "05 00  4D 00 00 00"                       // scan counter 5, encoder 77
      "00  00 00 00 00 00 00 D0 3F"              // on the pivot at 0.25 rad
      "01 00 00 00  00 00 20 40  00 00 61 44"    // one point, x 2.5, z 900
      "05 88 17 83"                              //
      "65 6E 64 2E  00 00 00 00  27 9A 34 CB");  // end.
  Record record;
  record.origin = {"0.1.0", 7, 42, 1'700'000'000'123};
  record.cell.cell = {"c.toml", "a=1\n"};
  auto& scan = record.scan.emplace();
  scan.figures = {std::chrono::milliseconds(1500), 1, 0, 3};
  scan.profiles = {profile_of(5, Angle::rad(0.25))};
  auto& profile = scan.profiles.front().profile;
  profile.x_mm = {2.5F};
  profile.z_mm = {900};
  profile.measured_at = TimePoint{std::chrono::microseconds(900)};
  profile.received_at = TimePoint{std::chrono::microseconds(1000)};
  EXPECT_EQ(encode(record), file);
  const auto decoded = decode(file);
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_EQ(encode(*decoded), file);
}

TEST(RecordCodec, EveryFieldComesBack) {
  const Record record = record_of_all_fields();
  const auto decoded = decode(encode(record));
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_EQ(encode(*decoded), encode(record));
  // What the bytes could not tell if it were left out on both ways.
  EXPECT_EQ(decoded->origin.cycle_id, 42U);
  EXPECT_EQ(decoded->cell.parts.at(1).text, record.cell.parts[1].text);
  EXPECT_EQ(decoded->cell.knowledge_bases.at(0).checksum, 0x0123456789ABCDEFU);
  EXPECT_EQ(decoded->request->request.supply_id, 2);
  EXPECT_EQ(decoded->request->supply, 1U);
  const auto& profile = decoded->scan->profiles.at(1);
  EXPECT_EQ(profile.profile.z_mm.at(1), 901.25F);
  EXPECT_TRUE(std::isnan(profile.profile.x_mm.at(2)));
  const auto& flange = std::get<Transform<frame::Base, frame::Flange>>(profile.carrier);
  EXPECT_EQ(flange.iso.matrix(), (transform_of<frame::Base, frame::Flange>(0.3).iso.matrix()));
  EXPECT_EQ(decoded->scan->figures.profiles_lost, 3U);
  EXPECT_EQ(decoded->scan_of_cycle, 41U);
  const DetectResult& result = *decoded->result;
  EXPECT_EQ(result.loops, "avx2");
  EXPECT_EQ(result.report.detections.at(0).covariance.reshaped()[35], 35);
  EXPECT_EQ(result.report.detections.at(0).evidence[vision::Clue::Known], 0.25F);
  EXPECT_EQ(result.report.rejected.at(0).reason, "edges missing");
  EXPECT_EQ(result.report.stages_ms.at("surface"), 2.5);
  EXPECT_TRUE(result.report.cut_short);
  EXPECT_EQ(result.report.first->hypotheses, 17U);
  const vision::Reachable& reachable = result.choice.reachable.at(0);
  EXPECT_EQ(reachable.grasp, 1U);
  EXPECT_TRUE(reachable.T_supply_retreat.iso.isApprox(transform_of<frame::Supply, frame::Tcp>(1.3).iso));
  EXPECT_EQ(reachable.covered_mm, 2.5);
  EXPECT_TRUE(reachable.is_tight && reachable.is_aslant);
  EXPECT_EQ(result.choice.unreachable.at(0).reason, "tilt 51 deg is over 40 deg");
  EXPECT_TRUE(result.supply_empty);
  EXPECT_EQ(decoded->answer->registers, (std::vector<std::uint16_t>{1, 2, 65535}));
  EXPECT_EQ(decoded->answer->alarm, plc::Alarm::ScanTimeout);
}

// Records of before the retreat pose do not tell it: nothing to compare with, and no difference.
TEST(RecordCodec, AReplayComparesTheRetreatPoseWhereItIsRecorded) {
  const DetectResult now = result_of_all_fields();
  DetectResult then = now;
  EXPECT_TRUE(differences(then, now).empty());
  then.choice.reachable.at(0).T_supply_retreat = {};
  EXPECT_TRUE(differences(then, now).empty());
  then.choice.reachable.at(0).T_supply_retreat = transform_of<frame::Supply, frame::Tcp>(1.4);
  EXPECT_EQ(differences(then, now).size(), 1U);
}

TEST(RecordCodec, AnEmptyRecordIsOne) {
  const auto decoded = decode(encode(Record{}));
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_FALSE(decoded->request || decoded->scan || decoded->scan_of_cycle || decoded->result || decoded->answer);
}

TEST(RecordCodec, EveryPrefixIsCutOff) {
  const Bytes file = encode(record_of_all_fields());
  for (std::size_t n = 0; n < file.size(); ++n) {
    const auto decoded = decode(ByteView{file}.first(n));
    ASSERT_FALSE(decoded.has_value()) << n;
    ASSERT_EQ(decoded.error().kind, Kind::CutOff) << n << ": " << decoded.error().text;
  }
  EXPECT_EQ(decode(ByteView{file}.first(file.size() - 1)).error().text, "is cut off after its section answ");
}

TEST(RecordCodec, EveryChangedByteIsSeen) {
  const Bytes file = encode(record_of_all_fields());
  for (std::size_t i = 0; i < file.size(); ++i)
    for (const int flip : {0x01, 0x80, 0xFF}) {
      Bytes changed = file;
      changed[i] ^= static_cast<std::byte>(flip);
      ASSERT_FALSE(decode(changed).has_value()) << i;
    }
  Bytes longer = file;
  longer.push_back({});
  EXPECT_EQ(decode(longer).error().kind, Kind::Damaged);
}

TEST(RecordCodec, TellsWhatElseItIsNot) {
  EXPECT_EQ(decode(as_bytes("ply\nformat ascii 1.0\n")).error().kind, Kind::NotARecord);
  Bytes later = encode(Record{});
  later[8] = std::byte{9};
  EXPECT_EQ(decode(later).error().kind, Kind::Version);
  EXPECT_EQ(read_record("/nowhere/a.bpr").error().kind, Kind::CannotRead);
}

// An older program reads what a newer one wrote, and the other way round.
TEST(RecordCodec, SkipsWhatALaterVersionAdded) {
  const Record record = record_of_all_fields();
  const Bytes more = with_section(encode(record), "news", from_hex("01 02 03"));
  auto decoded = decode(more);
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_EQ(encode(*decoded), encode(record));

  Record plain;
  Bytes longer_section =
      with_section(encode(plain), "requ", from_hex("09 00 01 00 02 00  01 00 00 00  00 00 00 00  FF EE"));
  decoded = decode(longer_section);
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_EQ(decoded->request->request.sequence, 9);
  decoded = decode(with_section(encode(plain), "requ", from_hex("09 00 01 00")));
  ASSERT_TRUE(decoded.has_value()) << decoded.error().text;
  EXPECT_EQ(decoded->request->request.part_id, 1);
  EXPECT_EQ(decoded->request->request.supply_id, 0);
}

TEST(RecordCodec, ForgedContentIsRefused) {
  const Bytes plain = encode(Record{});
  for (const char* forged : {
           "09",  // half a number
           "00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00"
           "FF FF FF 00",  // more profiles than bytes
           "00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00"
           "01 00 00 00  23 00 00 00  00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00  00 00  00 00 00 00"
           "02  00 00 00 00 00 00 00 00  00 00 00 00",  // a carrier that there is not
       }) {
    const auto decoded = decode(with_section(plain, "scan", from_hex(forged)));
    ASSERT_FALSE(decoded.has_value()) << forged;
    EXPECT_EQ(decoded.error().kind, Kind::Content) << decoded.error().text;
  }
  const auto headless = decode(from_hex("42 49 4E 50 49 43 4B 52 01 00 00 00 65 6E 64 2E 00 00 00 00 27 9A 34 CB"));
  EXPECT_EQ(headless.error().kind, Kind::Content);
}
}  // namespace
}  // namespace binpick::daemon
