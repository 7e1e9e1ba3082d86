#include "drivers/robot/dialect.hpp"

#include <Eigen/Geometry>
#include <array>
#include <gtest/gtest.h>
#include <random>
#include <string>
#include <vector>

#include "base/rotation.hpp"
#include "drivers/robot/codec.hpp"

namespace binpick::drivers::robot {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::array kDialects{Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki};

Pick pick_at(const Matrix3d& R_approach, const Matrix3d& R_grasp) {
  Pick pick{17, 118, 2, 11, {}, {}, {}};
  pick.T_base_approach.iso.translation() = Vector3d{1234.5678, -250, 600.0004};
  pick.T_base_approach.iso.linear() = R_approach;
  pick.T_base_grasp.iso.translation() = Vector3d{1234.5678, -250, 500};
  pick.T_base_grasp.iso.linear() = R_grasp;
  pick.T_base_retreat.iso.translation() = Vector3d{1199.25, -210.5, 590};
  pick.T_base_retreat.iso.linear() = pick.T_base_grasp.iso.linear();
  return pick;
}
Pick example_pick() { return pick_at(from_wpr_deg({175, -12, -100}), from_wpr_deg({10, 20, 30})); }

Pick id_only(std::uint16_t id) {
  Pick pick;
  pick.pick_id = id;
  return pick;
}

struct Telegram {
  const char* what;
  Dialect dialect;
  Reply reply;
  std::string text;
};

// No pose, in each dialect: fifteen numbers.
const std::string kUrZero =
    "0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,"
    "0.000000,0.000000,0.000000,0.0000000,0.0000000,0.0000000,"
    "0.000000,0.000000,0.000000";
const std::string kFanucZero = "000000.000,000000.000,000000.000,00000.0000,00000.0000,00000.0000";
const std::string kFanucZeroPosition = "000000.000,000000.000,000000.000";
const std::string kKawasakiZero =
    "0.000,0.000,0.000,0.0000,0.0000,0.0000,0.000,0.000,0.000,0.0000,0.0000,0.0000,0.000,0.000,0.000";

/// Every answer of each dialect, byte by byte. Fields: version, status, pick id, sequence, part, left, approach (6),
/// grasp (6), retreat (3, position only), reported id, outcome. The angles of the pick were computed apart from this
/// code (base/rotation's test vectors to more decimals).
const std::vector<Telegram>& telegrams() {
  using enum Dialect;
  static const std::vector<Telegram> all = [] {
    std::vector<Telegram> list{
        // x y z in m, rotation vector in rad; one group in parentheses, LF
        {"pick",
         UniversalRobots,
         {Status::Pick, example_pick(), 16, Outcome::Failed},
         "(2,1,17,118,2,11,"                                            // heading
         "1.234568,-0.250000,0.600000,1.8690257,-2.2482907,0.0997368,"  // approach
         "1.234568,-0.250000,0.500000,0.0775253,0.3848516,0.4864792,"   // grasp
         "1.199250,-0.210500,0.590000,"                                 // retreat
         "16,2)\n"},                                                    // last report
        // three lines of fixed columns, each ended by CR LF; x y z in mm, W P R in degrees
        {"pick",
         Fanuc,
         {Status::Pick, example_pick(), 16, Outcome::Failed},
         "00002,00001,00017,00118,00002,00011\r\n"
         "001234.568,-00250.000,000600.000,00175.0000,-0012.0000,-0100.0000\r\n"
         "001234.568,-00250.000,000500.000,00010.0000,00020.0000,00030.0000,"
         "001199.250,-00210.500,000590.000,00016,00002\r\n"},
        // one line ended by CR LF; x y z in mm, O A T in degrees
        {"pick",
         Kawasaki,
         {Status::Pick, example_pick(), 16, Outcome::Failed},
         "2,1,17,118,2,11,"
         "1234.568,-250.000,600.000,-122.8212,167.0141,157.7046,"
         "1234.568,-250.000,500.000,2.7268,22.2687,25.5056,"
         "1199.250,-210.500,590.000,"
         "16,2\r\n"},
    };
    struct Short {
      const char* what;
      Reply reply;
      const char* heading;  // without the version
      const char* fanuc_heading;
      const char* last;
      const char* fanuc_last;
    };
    for (const Short& s : std::vector<Short>{{"not ready",
                                              {Status::NotReady, {}, 0, Outcome::None},
                                              "0,0,0,0,0",
                                              "00000,00000,00000,00000,00000",
                                              "0,0",
                                              "00000,00000"},
                                             {"report taken",
                                              {Status::ReportTaken, id_only(17), 17, Outcome::Done},
                                              "2,17,0,0,0",
                                              "00002,00017,00000,00000,00000",
                                              "17,1",
                                              "00017,00001"},
                                             {"hello",
                                              {Status::Hello, id_only(17), 16, Outcome::Failed},
                                              "3,17,0,0,0",
                                              "00003,00017,00000,00000,00000",
                                              "16,2",
                                              "00016,00002"},
                                             {"supply empty",
                                              {Status::SupplyEmpty, {}, 16, Outcome::Done},
                                              "10,0,0,0,0",
                                              "00010,00000,00000,00000,00000",
                                              "16,1",
                                              "00016,00001"},
                                             {"nothing found",
                                              {Status::NothingFound, {}, 16, Outcome::Done},
                                              "11,0,0,0,0",
                                              "00011,00000,00000,00000,00000",
                                              "16,1",
                                              "00016,00001"},
                                             {"not reachable",
                                              {Status::NotReachable, {}, 16, Outcome::Done},
                                              "12,0,0,0,0",
                                              "00012,00000,00000,00000,00000",
                                              "16,1",
                                              "00016,00001"},
                                             {"fault",
                                              {Status::Fault, {}, 16, Outcome::Done},
                                              "40,0,0,0,0",
                                              "00040,00000,00000,00000,00000",
                                              "16,1",
                                              "00016,00001"},
                                             {"unknown pick",
                                              {Status::UnknownPick, id_only(65535), 0, Outcome::None},
                                              "50,65535,0,0,0",
                                              "00050,65535,00000,00000,00000",
                                              "0,0",
                                              "00000,00000"},
                                             {"bad request",
                                              {Status::BadRequest, {}, 65535, Outcome::Done},
                                              "51,0,0,0,0",
                                              "00051,00000,00000,00000,00000",
                                              "65535,1",
                                              "65535,00001"}}) {
      list.push_back(
          {s.what, UniversalRobots, s.reply, "(2," + std::string(s.heading) + "," + kUrZero + "," + s.last + ")\n"});
      list.push_back({s.what, Fanuc, s.reply,
                      "00002," + std::string(s.fanuc_heading) + "\r\n" + kFanucZero + "\r\n" + kFanucZero + "," +
                          kFanucZeroPosition + "," + s.fanuc_last + "\r\n"});
      list.push_back(
          {s.what, Kawasaki, s.reply, "2," + std::string(s.heading) + "," + kKawasakiZero + "," + s.last + "\r\n"});
    }
    return list;
  }();
  return all;
}

struct RequestBytes {
  Dialect dialect;
  Request request;
  const char* bytes;
};
constexpr std::array kRequests{
    RequestBytes{Dialect::UniversalRobots, {Request::Kind::Hello, 0}, "hello\n"},
    RequestBytes{Dialect::UniversalRobots, {Request::Kind::Fetch, 0}, "fetch\n"},
    RequestBytes{Dialect::UniversalRobots, {Request::Kind::Done, 17}, "done 17\n"},
    RequestBytes{Dialect::UniversalRobots, {Request::Kind::Failed, 65535}, "failed 65535\n"},
    RequestBytes{Dialect::Fanuc, {Request::Kind::Hello, 0}, "hello\r\n"},
    RequestBytes{Dialect::Fanuc, {Request::Kind::Fetch, 0}, "fetch\r\n"},
    RequestBytes{Dialect::Fanuc, {Request::Kind::Done, 17}, "done 17\r\n"},
    RequestBytes{Dialect::Fanuc, {Request::Kind::Failed, 65535}, "failed 65535\r\n"},
    RequestBytes{Dialect::Kawasaki, {Request::Kind::Hello, 0}, "hello\r\n"},
    RequestBytes{Dialect::Kawasaki, {Request::Kind::Fetch, 0}, "fetch\r\n"},
    RequestBytes{Dialect::Kawasaki, {Request::Kind::Done, 17}, "done 17\r\n"},
    RequestBytes{Dialect::Kawasaki, {Request::Kind::Failed, 65535}, "failed 65535\r\n"},
};

/// What the KAREL program of docs/robots/fanuc.md makes of an answer: three lines into STRINGs of 128 characters, the
/// numbers cut out by column. Written without the codec.
std::vector<double> karel_reads(const std::string& text) {
  std::vector<std::string> lines{""};
  for (const char c : text) {
    if (c > ' ')
      lines.back() += c;
    else if (!lines.back().empty())
      lines.emplace_back();
  }
  lines.pop_back();
  if (lines.size() != 3) return {};
  for (const std::string& line : lines)
    if (line.size() > 128) return {};
  std::vector<double> numbers;
  const auto cut = [&](std::size_t line, std::size_t first, std::size_t length) {
    numbers.push_back(std::stod(lines[line].substr(first - 1, length)));  // SUB_STR counts from 1
  };
  for (std::size_t i = 0; i < 6; ++i) cut(0, 1 + 6 * i, 5);
  for (std::size_t i = 0; i < 6; ++i) cut(1, 1 + 11 * i, 10);
  for (std::size_t i = 0; i < 9; ++i) cut(2, 1 + 11 * i, 10);
  for (std::size_t i = 0; i < 2; ++i) cut(2, 100 + 6 * i, 5);
  return numbers;
}

/// What the AS program of docs/robots/kawasaki.md makes of an answer: one string of at most 255 characters, taken apart
/// by $DECODE and VAL. Written without the codec.
std::vector<double> as_reads(std::string text) {
  if (text.size() > 255 || !text.ends_with("\r\n")) return {};
  text.resize(text.size() - 2);
  std::vector<double> numbers;
  while (!text.empty()) {
    const std::string word = text.substr(0, text.find(','));  // $DECODE(text, ",", 0)
    numbers.push_back(std::stod(word));                       // VAL
    text.erase(0, word.size());
    if (!text.empty()) text.erase(0, 1);  // $DECODE(text, ",", 1)
  }
  return numbers;
}

std::string label(const Telegram& t) {
  return std::string(t.what) + ", dialect " + std::to_string(static_cast<int>(t.dialect));
}

/// Bytes of the answer up to which the robot has to wait.
std::size_t whole(const Telegram& t) { return t.text.size() - format_of(t.dialect).end.size(); }

bool in_range(const Transform<frame::Base, frame::Tcp>& T) {
  return T.iso.translation().cwiseAbs().maxCoeff() <= kLengthMax_mm * (1 + 1e-12) &&
         (T.iso.linear() * T.iso.linear().transpose()).isIdentity(1e-9) && T.iso.linear().determinant() > 0;
}

double angle_between(const Matrix3d& a, const Matrix3d& b) { return to_rotation_vector(a.transpose() * b).norm(); }
}  // namespace

TEST(RobotDialect, EachAnswerIsTheseBytesAndIsReadBack) {
  for (const Telegram& t : telegrams()) {
    SCOPED_TRACE(label(t));
    EXPECT_EQ(encode(t.reply, t.dialect), t.text);
    const auto decoded = decode_reply(t.text, t.dialect);
    ASSERT_TRUE(decoded && *decoded);
    EXPECT_EQ((*decoded)->consumed, whole(t));
    const Reply& reply = (*decoded)->reply;
    EXPECT_EQ(reply.status, t.reply.status);
    EXPECT_EQ(reply.pick.pick_id, t.reply.pick.pick_id);
    EXPECT_EQ(reply.pick.sequence, t.reply.pick.sequence);
    EXPECT_EQ(reply.pick.part_id, t.reply.pick.part_id);
    EXPECT_EQ(reply.pick.objects_left, t.reply.pick.objects_left);
    EXPECT_EQ(reply.reported_id, t.reply.reported_id);
    EXPECT_EQ(reply.outcome, t.reply.outcome);
    EXPECT_LT((reply.pick.T_base_retreat.iso.translation() - t.reply.pick.T_base_retreat.iso.translation()).norm(),
              1e-9);
    EXPECT_TRUE(reply.pick.T_base_retreat.iso.linear() == reply.pick.T_base_grasp.iso.linear());
    EXPECT_EQ(encode(reply, t.dialect), t.text);
  }
}

TEST(RobotDialect, EachRequestIsTheseBytesAndIsReadInAnyPieces) {
  for (const RequestBytes& r : kRequests) {
    const std::string bytes = r.bytes;
    EXPECT_EQ(encode(r.request, r.dialect), bytes);
    for (std::size_t split = 0; split <= bytes.size(); ++split) {
      LineReader reader;
      std::vector<Request> requests;
      for (const auto& part : {bytes.substr(0, split), bytes.substr(split)}) {
        reader.push(as_bytes(part));
        while (const auto line = reader.next()) requests.push_back(decode_request(line->value()).value());
      }
      ASSERT_EQ(requests.size(), 1U) << bytes << split;
      EXPECT_EQ(requests[0].kind, r.request.kind);
      EXPECT_EQ(requests[0].pick_id, r.request.pick_id);
    }
  }
}

TEST(RobotDialect, EachPrefixOfEachAnswerWaitsForTheRest) {
  for (const Telegram& t : telegrams())
    for (std::size_t n = 0; n < whole(t); ++n) {
      const auto decoded = decode_reply(t.text.substr(0, n), t.dialect);
      ASSERT_TRUE(decoded.has_value()) << label(t) << " " << n << ": " << decoded.error().text;
      ASSERT_FALSE(decoded->has_value()) << label(t) << " " << n;
    }
}

TEST(RobotDialect, EachCorruptedByteOfEachAnswerIsAnErrorOrAValueInRange) {
  for (const Telegram& t : telegrams()) {
    int errors = 0;
    for (std::size_t at = 0; at < t.text.size(); ++at)
      for (int value = 0; value < 256; ++value) {
        std::string corrupted = t.text;
        corrupted[at] = static_cast<char>(value);
        const auto decoded = decode_reply(corrupted, t.dialect);
        if (!decoded) {
          ++errors;
        } else if (*decoded) {
          ASSERT_LE((*decoded)->consumed, corrupted.size());
          ASSERT_TRUE(in_range((*decoded)->reply.pick.T_base_approach)) << label(t) << " " << corrupted;
          ASSERT_TRUE(in_range((*decoded)->reply.pick.T_base_grasp)) << label(t) << " " << corrupted;
          ASSERT_TRUE(in_range((*decoded)->reply.pick.T_base_retreat)) << label(t) << " " << corrupted;
        }
      }
    EXPECT_GT(errors, 200 * static_cast<int>(t.text.size())) << label(t);
  }
}

TEST(RobotDialect, AnAnswerInAnotherDialectIsNeverTakenForAPick) {
  for (const Telegram& t : telegrams())
    for (const Dialect other : kDialects) {
      if (other == t.dialect) continue;
      const auto decoded = decode_reply(t.text, other);
      EXPECT_FALSE(decoded.has_value()) << label(t) << " read as " << static_cast<int>(other);
    }
}

TEST(RobotDialect, EndlessAnswersAndWrongCountsAreRefused) {
  for (const Dialect dialect : {Dialect::Fanuc, Dialect::Kawasaki}) {
    EXPECT_FALSE(decode_reply(std::string(600, '1'), dialect));
    const std::string good = encode(Reply{}, dialect);
    const std::string bare = good.substr(0, good.size() - 2);
    EXPECT_FALSE(decode_reply(bare + ",0\r\n", dialect)) << "24 numbers";
    EXPECT_FALSE(decode_reply(bare.substr(0, bare.rfind(',')) + "\r\n", dialect)) << "22 numbers";
    std::string other_version = good;
    other_version[good.find('2')] = '3';
    EXPECT_FALSE(decode_reply(other_version, dialect));
    other_version[good.find('2')] = '1';
    EXPECT_EQ(decode_reply(other_version.substr(0, 60), dialect).error().text, "protocol version is not 2");
  }
}

TEST(RobotDialect, FanucLinesHaveTheirColumnsWhateverTheNumbers) {
  Pick pick{65535, 65535, 65535, 65535, {}, {}, {}};
  for (auto* T_base_tcp : {&pick.T_base_approach, &pick.T_base_grasp, &pick.T_base_retreat}) {
    T_base_tcp->iso.translation() = Vector3d{-99'998.9996, 99'998.9996, -0.0001};
    T_base_tcp->iso.linear() = from_wpr_deg({-179.9999, -89.5, -123.4567});
  }
  for (const Reply& reply : {Reply{}, Reply{Status::BadRequest, pick, 65535, Outcome::Failed}}) {
    const std::string text = encode(reply, Dialect::Fanuc);
    EXPECT_EQ(text.size(), 35U + 65U + 110U + 3U * 2U);
    EXPECT_EQ(text.find("\r\n"), 35U);
    EXPECT_EQ(text.find("\r\n", 37), 37U + 65U);
    EXPECT_EQ(karel_reads(text).size(), kReplyFields);
  }
  for (auto* T_base_tcp : {&pick.T_base_approach, &pick.T_base_grasp, &pick.T_base_retreat}) {
    T_base_tcp->iso.translation().setConstant(-99'998.9994);
    T_base_tcp->iso.linear() = from_oat_deg({-123.4567, 123.4567, -123.4567});
  }
  const std::string kawasaki = encode(Reply{Status::BadRequest, pick, 65535, Outcome::Failed}, Dialect::Kawasaki);
  EXPECT_EQ(kawasaki.size(), 2U + 3 + 4 * 6 + 9 * 11 + 2 * (10 + 9 + 10) + 6 + 1 + 2) << kawasaki;
  EXPECT_LE(kawasaki.size(), 255U) << "one string of AS";
}

TEST(RobotDialect, TheControllersReadThePoseInTheirUnits) {
  const Reply reply{Status::Pick, example_pick(), 16, Outcome::Failed};
  const std::vector<double> heading{2, 1, 17, 118, 2, 11};
  const std::vector<double> fanuc{1234.568, -250, 600, 175,     -12,    -100, 1234.568, -250, 500,
                                  10,       20,   30,  1199.25, -210.5, 590,  16,       2};
  const std::vector<double> kawasaki{1234.568, -250,    600,     -122.8212, 167.0141, 157.7046, 1234.568, -250, 500,
                                     2.7268,   22.2687, 25.5056, 1199.25,   -210.5,   590,      16,       2};
  for (const auto& [numbers, expected] : {std::pair{karel_reads(encode(reply, Dialect::Fanuc)), fanuc},
                                          {as_reads(encode(reply, Dialect::Kawasaki)), kawasaki}}) {
    ASSERT_EQ(numbers.size(), kReplyFields);
    EXPECT_EQ((std::vector<double>(numbers.begin(), numbers.begin() + 6)), heading);
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(numbers[6 + i], expected[i], 1e-9) << i;
  }
}

TEST(RobotDialect, TheStraightDownToolHasOneText) {
  std::mt19937 random{5};
  std::uniform_real_distribution<double> noise{-1e-8, 1e-8};
  const auto shaken = [&](const Matrix3d& R) -> Matrix3d {
    return from_rotation_vector({noise(random), noise(random), noise(random)}) * R;
  };
  struct Down {
    double turn_deg;  // about base z, from a tool that was tipped about x
    const char *fanuc, *kawasaki;
  };
  // W P R and O A T of the same rotation: 180 0 R, and R + 180, 180, 0.
  for (const Down& down : {Down{0, "00180.0000,00000.0000,00000.0000", "180.0000,180.0000,0.0000"},
                           Down{45, "00180.0000,00000.0000,00045.0000", "-135.0000,180.0000,0.0000"},
                           Down{-150, "00180.0000,00000.0000,-0150.0000", "30.0000,180.0000,0.0000"},
                           Down{180, "00180.0000,00000.0000,00180.0000", "0.0000,180.0000,0.0000"}}) {
    const Matrix3d R = from_wpr_deg({180, 0, down.turn_deg});
    for (int i = 0; i < 200; ++i) {
      const Reply reply{Status::Pick, pick_at(shaken(R), shaken(R)), 0, Outcome::None};
      ASSERT_NE(encode(reply, Dialect::Fanuc).find(std::string("000600.000,") + down.fanuc + "\r\n"), std::string::npos)
          << encode(reply, Dialect::Fanuc);
      ASSERT_NE(encode(reply, Dialect::Kawasaki).find(std::string("600.000,") + down.kawasaki + ","), std::string::npos)
          << encode(reply, Dialect::Kawasaki);
    }
  }
}

TEST(RobotDialect, FanucsGimbalPosesHaveOneText) {
  std::mt19937 random{6};
  std::uniform_real_distribution<double> noise{-1e-8, 1e-8};
  struct Gimbal {
    Vector3d wpr_deg;
    const char* text;
  };
  for (const Gimbal& gimbal : {Gimbal{{30, 90, 0}, "00030.0000,00090.0000,00000.0000"},
                               Gimbal{{40, 90, 10}, "00030.0000,00090.0000,00000.0000"},
                               Gimbal{{-170, 90, 20}, "00170.0000,00090.0000,00000.0000"},
                               Gimbal{{40, -90, 10}, "00050.0000,-0090.0000,00000.0000"},
                               Gimbal{{100, -90, 80}, "00180.0000,-0090.0000,00000.0000"}}) {
    for (int i = 0; i < 200; ++i) {
      const Matrix3d R =
          from_rotation_vector({noise(random), noise(random), noise(random)}) * from_wpr_deg(gimbal.wpr_deg);
      const std::string text = encode(Reply{Status::Pick, pick_at(R, R), 0, Outcome::None}, Dialect::Fanuc);
      ASSERT_NE(text.find(std::string("000600.000,") + gimbal.text + "\r\n"), std::string::npos) << text;
    }
  }
}

TEST(RobotDialect, TwentyThousandRandomPosesKeepTheResolutionOfTheText) {
  std::mt19937 random{20260102};
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> coordinate_mm{-20'000, 20'000};
  for (int i = 0; i < 20'000; ++i) {
    Matrix3d R = Eigen::Quaterniond{normal(random), normal(random), normal(random), normal(random)}
                     .normalized()
                     .toRotationMatrix();
    // Every tenth points straight down, or nearly so, in steps around what the text can tell.
    if (i % 10 == 0) R = from_oat_deg({36.0 * normal(random), 180 - 1e-5 * (i % 17), 36.0 * normal(random)});
    if (i % 10 == 5) R = from_wpr_deg({36.0 * normal(random), 90 - 1e-5 * (i % 17), 36.0 * normal(random)});
    Pick pick = pick_at(R, R);
    for (auto* T_base_tcp : {&pick.T_base_grasp, &pick.T_base_retreat})
      T_base_tcp->iso.translation() = Vector3d{coordinate_mm(random), coordinate_mm(random), coordinate_mm(random)};
    for (const Dialect dialect : kDialects) {
      const auto decoded = decode_reply(encode(Reply{Status::Pick, pick, 0, Outcome::None}, dialect), dialect);
      ASSERT_TRUE(decoded && *decoded) << i;
      const auto& T = (*decoded)->reply.pick.T_base_grasp.iso;
      ASSERT_LT((T.translation() - pick.T_base_grasp.iso.translation()).cwiseAbs().maxCoeff(), 0.00051) << i;
      const auto& T_retreat = (*decoded)->reply.pick.T_base_retreat.iso;
      ASSERT_LT((T_retreat.translation() - pick.T_base_retreat.iso.translation()).cwiseAbs().maxCoeff(), 0.00051) << i;
      ASSERT_TRUE(T_retreat.linear() == T.linear());
      // Half a step of 0.0001 degrees in each of three angles, and once more where two become one.
      ASSERT_LT(angle_between(T.linear(), R), 4 * 0.00005 * 3.14159 / 180) << i << " " << static_cast<int>(dialect);
    }
  }
}
}  // namespace binpick::drivers::robot
