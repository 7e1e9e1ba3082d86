#include "drivers/robot/codec.hpp"

#include <gtest/gtest.h>
#include <numbers>
#include <string>
#include <vector>

#include "base/rotation.hpp"

namespace binpick::drivers::robot {
namespace {
using Eigen::Vector3d;

/// The other dialects have their own tables (dialect_test.cpp).
constexpr Dialect kUr = Dialect::UniversalRobots;

Pick example_pick() {
  Pick pick{17, 118, 2, 11, {}, {}, {}};
  pick.T_base_approach.iso.translation() = Vector3d{1234.5678, -250, 600.0004};
  pick.T_base_approach.iso.linear() = from_wpr_deg({180, 0, 45});
  pick.T_base_grasp.iso.translation() = Vector3d{1234.5678, -250, 500};
  pick.T_base_grasp.iso.linear() = from_wpr_deg({10, 20, 30});
  pick.T_base_retreat.iso.translation() = Vector3d{1199.25, -210.5, 590};
  pick.T_base_retreat.iso.linear() = pick.T_base_grasp.iso.linear();
  return pick;
}

/// What URScript's socket_read_ascii_float(n) makes of a text, after its manual: the count, then the numbers; a group
/// is opened and closed by parentheses, numbers stand between commas. Written without the codec.
std::vector<double> socket_read_ascii_float(std::size_t n, const std::string& text) {
  const std::size_t open = text.find('('), close = text.find(')');
  if (open == std::string::npos || close == std::string::npos || n > 30) return {0};
  std::vector<double> list{0};
  std::size_t at = open + 1;
  while (at < close && list.size() <= n) {
    std::size_t used = 0;
    list.push_back(std::stod(text.substr(at, close - at), &used));
    at += used;
    if (at < close && text[at] != ',') return {0};
    ++at;
  }
  list[0] = static_cast<double>(list.size() - 1);
  return list;
}

std::string describe(const Expected<Request, BadLine>& request) {
  if (!request) return "bad: " + to_string(request.error());
  std::string text = encode(*request, kUr);
  text.pop_back();
  return text;
}
}  // namespace

TEST(RobotCodec, RequestsAsARobotWritesThem) {
  EXPECT_EQ(describe(decode_request("hello")), "hello");
  EXPECT_EQ(describe(decode_request("fetch")), "fetch");
  EXPECT_EQ(describe(decode_request("done 1")), "done 1");
  EXPECT_EQ(describe(decode_request("failed 65535")), "failed 65535");
  EXPECT_EQ(describe(decode_request("  done   17 ")), "done 17");
}

TEST(RobotCodec, WhatIsNoRequestSaysWhy) {
  for (const char* line : {"", " ", "FETCH", "fetchfetch", "get", "fe tch", "done17", "(1)"})
    EXPECT_EQ(decode_request(line).error().kind, BadLine::Kind::UnknownWord) << line;
  for (const char* line :
       {"done", "done 0", "done -1", "done 65536", "done 1.0", "done x", "failed 99999999999999999999"})
    EXPECT_EQ(decode_request(line).error().kind, BadLine::Kind::BadNumber) << line;
  for (const char* line : {"fetch 1", "hello robot", "done 1 2"})
    EXPECT_EQ(decode_request(line).error().kind, BadLine::Kind::TooManyWords) << line;
  EXPECT_EQ(decode_request(std::string("fet\0ch", 6)).error().kind, BadLine::Kind::NotText);
  EXPECT_EQ(decode_request("fetch\xff").error().kind, BadLine::Kind::NotText);
  EXPECT_EQ(decode_request("fetch\t").error().kind, BadLine::Kind::NotText);
  EXPECT_EQ(decode_request(std::string(127, 'x')).error().kind, BadLine::Kind::TooLong);
}

TEST(RobotCodec, AnswersAreTheseBytes) {
  // version, status, pick id, sequence, part, left, approach, grasp, retreat (position), reported id, outcome
  EXPECT_EQ(encode(Reply{Status::NotReady, {}, 0, Outcome::None}, kUr),
            "(2,0,0,0,0,0,"
            "0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,"
            "0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,"
            "0.000000,0.000000,0.000000,0,0)\n");
  Pick pick{17, 118, 2, 11, {}, {}, {}};
  pick.T_base_approach.iso.translation() = Vector3d{1234.5678, -250, 600.0004};
  pick.T_base_approach.iso.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // half a turn about x
  pick.T_base_grasp.iso.translation() = Vector3d{-0.0123, 0, 500};
  pick.T_base_grasp.iso.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;  // a quarter of a turn about z
  pick.T_base_retreat.iso.translation() = Vector3d{-0.0123, 120, 600.0004};
  EXPECT_EQ(encode(Reply{Status::Pick, pick, 16, Outcome::Failed}, kUr),
            "(2,1,17,118,2,11,"
            "1.234568,-0.250000,0.600000,3.1415927,0.0000000,0.0000000,"
            "-0.000012,0.000000,0.500000,0.0000000,0.0000000,1.5707963,"
            "-0.000012,0.120000,0.600000,16,2)\n");
}

TEST(RobotCodec, UrScriptReadsEveryAnswerAs23Numbers) {
  for (const Reply& reply : {Reply{}, Reply{Status::Pick, example_pick(), 16, Outcome::Done},
                             Reply{Status::UnknownPick, {}, 65535, Outcome::Failed}}) {
    const auto list = socket_read_ascii_float(23, encode(reply, kUr));
    ASSERT_EQ(list.size(), 24U);
    EXPECT_EQ(list[0], 23);
    EXPECT_EQ(list[1], 2);
    EXPECT_EQ(list[2], static_cast<double>(reply.status));
  }
  const auto list = socket_read_ascii_float(23, encode(Reply{Status::Pick, example_pick(), 16, Outcome::Done}, kUr));
  EXPECT_EQ((std::vector<double>(list.begin() + 3, list.begin() + 7)), (std::vector<double>{17, 118, 2, 11}));
  // Metres; 180, 0, 45 of Fanuc is this rotation vector, 10, 20, 30 the other.
  const std::vector<double> approach{1.234568, -0.25, 0.6, 2.902453, 1.202235, 0};
  const std::vector<double> grasp{1.234568, -0.25, 0.5, 0.077525, 0.384852, 0.486479};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(list[7 + i], approach[i], 1e-6) << i;
    EXPECT_NEAR(list[13 + i], grasp[i], 1e-6) << i;
  }
  const std::vector<double> retreat{1.19925, -0.2105, 0.59};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(list[19 + i], retreat[i], 1e-9) << i;
  EXPECT_EQ(list[22], 16);
  EXPECT_EQ(list[23], 1);
}

TEST(RobotCodec, AnswersNeverHoldAnExponentAndKeepAHundredthOfAMillimetre) {
  Pick pick = example_pick();
  pick.T_base_grasp.iso.translation() = Vector3d{1e-9, 12345.678, -0.004};
  pick.T_base_grasp.iso.linear() = from_rotation_vector({1e-9, -1e-5, 0});
  const std::string text = encode(Reply{Status::Pick, pick, 0, Outcome::None}, kUr);
  EXPECT_EQ(text.find_first_not_of("()0123456789.,-\n"), std::string::npos) << text;
  const auto decoded = decode_reply(text, kUr);
  ASSERT_TRUE(decoded && *decoded);
  EXPECT_LT(((*decoded)->reply.pick.T_base_grasp.iso.translation() - pick.T_base_grasp.iso.translation()).norm(), 1e-3);
  EXPECT_LE(text.size(), 255U) << "one string of a controller";
  // The longest there can be.
  Pick longest{65535, 65535, 65535, 65535, {}, {}, {}};
  for (auto* T_base_tcp : {&longest.T_base_approach, &longest.T_base_grasp, &longest.T_base_retreat}) {
    T_base_tcp->iso.translation().setConstant(-99'998.9994);
    T_base_tcp->iso.linear() = from_rotation_vector({-1.7, -1.7, -1.7});
  }
  const Reply reply{Status::BadRequest, longest, 65535, Outcome::Failed};
  EXPECT_EQ(encode(reply, kUr).size(), 1U + 1 + 1 + 2 + 4 * 6 + 15 * 11 + 1 + 5 + 1 + 1 + 1 + 1);
}

TEST(RobotCodec, DecodingGivesBackWhatWasEncoded) {
  const Reply reply{Status::Pick, example_pick(), 16, Outcome::Failed};
  const std::string text = encode(reply, kUr);
  const auto decoded = decode_reply("\n" + text + "rest", kUr);
  ASSERT_TRUE(decoded && *decoded);
  EXPECT_EQ((*decoded)->consumed, text.size());  // one byte before it, the line end left
  EXPECT_EQ(encode((*decoded)->reply, kUr),
            encode(Reply{Status::Pick, (*decoded)->reply.pick, 16, Outcome::Failed}, kUr));
  EXPECT_EQ((*decoded)->reply.pick.pick_id, 17);
  EXPECT_EQ((*decoded)->reply.pick.objects_left, 11);
  EXPECT_TRUE((*decoded)->reply.pick.T_base_approach.iso.isApprox(reply.pick.T_base_approach.iso, 1e-5));
  EXPECT_TRUE((*decoded)->reply.pick.T_base_retreat.iso.isApprox(reply.pick.T_base_retreat.iso, 1e-5)) << "turned too";
}

TEST(RobotCodec, EachPrefixOfAnAnswerWaitsForTheRest) {
  const std::string text = encode(Reply{Status::Pick, example_pick(), 16, Outcome::Failed}, kUr);
  for (std::size_t n = 0; n + 1 < text.size(); ++n) {
    const auto decoded = decode_reply(text.substr(0, n), kUr);
    ASSERT_TRUE(decoded.has_value()) << n;
    EXPECT_FALSE(decoded->has_value()) << n;
  }
}

TEST(RobotCodec, EachCorruptedByteOfAnAnswerIsAnErrorOrAValueInRange) {
  const std::string text = encode(Reply{Status::Pick, example_pick(), 16, Outcome::Failed}, kUr);
  int errors = 0;
  for (std::size_t at = 0; at < text.size(); ++at)
    for (int value = 0; value < 256; ++value) {
      std::string corrupted = text;
      corrupted[at] = static_cast<char>(value);
      const auto decoded = decode_reply(corrupted, kUr);
      if (!decoded) {
        ++errors;
      } else if (*decoded) {
        EXPECT_TRUE((*decoded)->reply.pick.T_base_grasp.iso.matrix().allFinite());
        EXPECT_TRUE((*decoded)->reply.pick.T_base_retreat.iso.matrix().allFinite());
        EXPECT_LE((*decoded)->consumed, corrupted.size());
      }
    }
  EXPECT_GT(errors, 10'000);
}

TEST(RobotCodec, AnswersOfAnotherShapeAreRefused) {
  for (const char* text : {"17)", "(1,2)", "(1,,0)", "(a)", "()", "(1;2)"})
    EXPECT_FALSE(decode_reply(text, kUr)) << text;
  std::string endless = "(" + std::string(600, '1');
  EXPECT_FALSE(decode_reply(endless, kUr));
  std::string other_version = encode(Reply{}, kUr);
  other_version[1] = '3';
  EXPECT_FALSE(decode_reply(other_version, kUr));
  // A cell of before the retreat pose: its answer is shorter, and it is the version that is told of.
  const auto of_version_1 = decode_reply(
      "(1,0,0,0,0,0,0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,"
      "0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,0,0)\n",
      kUr);
  ASSERT_FALSE(of_version_1);
  EXPECT_EQ(of_version_1.error().text, "protocol version is not 2");
}

TEST(LineReader, EachSplitGivesTheSameLines) {
  const std::string text = "hello\nfetch\r\n\n\r\ndone 17\n";
  const std::vector<std::string> expected{"hello", "fetch", "done 17"};
  for (std::size_t first = 0; first <= text.size(); ++first)
    for (std::size_t second = first; second <= text.size(); ++second) {
      LineReader reader;
      std::vector<std::string> lines;
      for (const auto& part : {text.substr(0, first), text.substr(first, second - first), text.substr(second)}) {
        reader.push(as_bytes(part));
        while (const auto line = reader.next()) lines.push_back(line->value());
      }
      ASSERT_EQ(lines, expected) << first << " " << second;
    }
}

TEST(LineReader, ALineThatIsTooLongIsToldOnceAndTheNextIsGood) {
  for (const char* end : {"\n", "\r\n"}) {
    LineReader reader;
    reader.push(as_bytes(std::string(126, 'a') + end + std::string(127, 'b') + end + std::string(100'000, 'c') + end +
                         "fetch" + end));
    EXPECT_EQ(reader.next()->value().size(), 126U);
    EXPECT_EQ(reader.next()->error().kind, BadLine::Kind::TooLong);
    EXPECT_EQ(reader.next()->error().kind, BadLine::Kind::TooLong);
    EXPECT_EQ(reader.next()->value(), "fetch");
    EXPECT_FALSE(reader.next());
  }
}
}  // namespace binpick::drivers::robot
