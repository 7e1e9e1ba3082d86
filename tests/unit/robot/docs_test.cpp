#include <algorithm>
#include <cstdio>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "base/rotation.hpp"
#include "drivers/robot/codec.hpp"
#include "drivers/robot/pose_stream.hpp"

namespace binpick::drivers::robot {
namespace {
const char* const kPages[] = {"universal-robots", "fanuc", "kawasaki"};

std::string read_page(const std::string& make = "universal-robots") {
  std::ifstream file{std::string(BINPICK_SOURCE_DIR) + "/docs/robots/" + make + ".md"};
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}
}  // namespace

// The pages are what integrators program from: their numbers are those of the code.
TEST(RobotDocs, EveryStatusStandsInTheTableOfEachMake) {
  std::set<int> known;
  for (const Status status : {Status::NotReady, Status::Pick, Status::ReportTaken, Status::Hello, Status::SupplyEmpty,
                              Status::NothingFound, Status::NotReachable, Status::Fault, Status::UnknownPick,
                              Status::BadRequest, Status::Scan, Status::Go, Status::UnknownScan})
    known.insert(static_cast<int>(status));
  for (const char* make : kPages) {
    SCOPED_TRACE(make);
    const std::string page = read_page(make);
    const std::size_t table = page.find("| status | says |");
    ASSERT_NE(table, std::string::npos);
    std::set<int> written;
    const std::string rows = page.substr(table, page.find("\n\n", table) - table);
    const std::regex row{"\n\\| ([0-9]+) \\|"};
    for (std::sregex_iterator it{rows.begin(), rows.end(), row}, end; it != end; ++it)
      written.insert(std::stoi((*it)[1]));
    EXPECT_EQ(written, known);
    EXPECT_NE(page.find("at most " + std::to_string(kLineBytesMax) + " characters"), std::string::npos);
  }
}

TEST(RobotDocs, TheProgramReadsAsManyNumbersAsAreSent) {
  const std::string page = read_page();
  EXPECT_NE(page.find("socket_read_ascii_float(" + std::to_string(kReplyFields) + ", \"binpick\""), std::string::npos);
  EXPECT_NE(page.find("good = answer[0] == " + std::to_string(kReplyFields)), std::string::npos);
  EXPECT_NE(page.find("if answer[1] != " + std::to_string(kProtocolVersion) + ":"), std::string::npos);
  const std::size_t list = page.find("answer = [");
  ASSERT_NE(list, std::string::npos);
  const std::string entries = page.substr(list, page.find(']', list) - list);
  EXPECT_EQ(static_cast<std::size_t>(std::count(entries.begin(), entries.end(), ',')), kReplyFields)
      << "count and fields";
}

namespace {
Reply example() {
  Pick pick{17, 118, 2, 11, {}, {}, {}};
  pick.T_base_approach.iso.translation() = Eigen::Vector3d{1234.5678, -250, 600.0004};
  pick.T_base_approach.iso.linear() = from_wpr_deg({175, -12, -100});
  pick.T_base_grasp.iso.translation() = Eigen::Vector3d{1234.5678, -250, 500};
  pick.T_base_grasp.iso.linear() = from_wpr_deg({10, 20, 30});
  pick.T_base_retreat.iso.translation() = Eigen::Vector3d{1199.25, -210.5, 590};
  pick.T_base_retreat.iso.linear() = pick.T_base_grasp.iso.linear();
  return {Status::Pick, pick, 16, Outcome::Failed};
}

/// The answer as a block of an .md page: lines indented by four.
std::string as_block(const std::string& answer) {
  std::stringstream lines{answer};
  std::string block;
  for (std::string line; std::getline(lines, line);)
    block += "    " + line.substr(0, line.find_last_not_of("\r\n") + 1) + "\n";
  return block;
}

/// All numbers that stand in the first group of `pattern`.
std::vector<int> numbers(const std::string& text, const std::string& pattern) {
  const std::regex regex{pattern};
  std::vector<int> found;
  for (std::sregex_iterator it{text.begin(), text.end(), regex}, end; it != end; ++it)
    found.push_back(std::stoi((*it)[1]));
  return found;
}

void expect_requests(const std::string& page, const std::string& pattern, const std::set<std::string>& expected) {
  const std::regex regex{pattern};
  std::set<std::string> words;
  for (std::sregex_iterator it{page.begin(), page.end(), regex}, end; it != end; ++it) {
    words.insert((*it)[1]);
    const std::string word = (*it)[1];
    EXPECT_TRUE(decode_request(word == "hello" || word == "fetch" ? word : word + "    17")) << word;
  }
  EXPECT_EQ(words, expected);
}

const std::set<std::string> kRequests{"hello", "fetch", "done", "failed", "begin", "end", "broken"};

/// How often `pattern` stands in `text`.
long count(const std::string& text, const char* pattern) {
  const std::regex regex{pattern};
  return std::distance(std::sregex_iterator{text.begin(), text.end(), regex}, std::sregex_iterator{});
}

/// From `begin` to `end`, which both must be there, in this order.
std::string part_of(const std::string& page, const std::string& begin, const std::string& end) {
  const std::size_t from = page.find(begin), to = from == std::string::npos ? from : page.find(end, from);
  EXPECT_NE(to, std::string::npos) << begin << " … " << end;
  return to == std::string::npos ? "" : page.substr(from, to - from);
}

/// Each of `steps` stands in `code`, one after the other.
void expect_in_order(const std::string& code, const std::vector<std::string>& steps) {
  std::size_t at = 0;
  for (const std::string& step : steps) {
    const std::size_t found = code.find(step, at);
    ASSERT_NE(found, std::string::npos) << "not there, or not after the step before: " << step;
    at = found + step.size();
  }
}
}  // namespace

TEST(RobotDocs, TheExampleAnswersAreThoseOfTheCodec) {
  EXPECT_NE(read_page("fanuc").find("\n\n" + as_block(encode(example(), Dialect::Fanuc)) + "\n"), std::string::npos);
  EXPECT_NE(read_page("kawasaki").find("\n\n" + as_block(encode(example(), Dialect::Kawasaki)) + "\n"),
            std::string::npos);
}

TEST(RobotDocs, TheKarelProgramCutsTheColumnsThatAreSent) {
  const std::string page = read_page("fanuc");
  std::stringstream answer{encode(example(), Dialect::Fanuc)};
  std::vector<std::string> lines;
  for (std::string line; std::getline(answer, line);) lines.push_back(line.substr(0, line.size() - 1));
  ASSERT_EQ(lines.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NE(page.find("(STR_LEN(line[" + std::to_string(i + 1) + "]) = " + std::to_string(lines[i].size()) + ")"),
              std::string::npos);
  // Columns count from 1. Each number that is cut is a whole number of the line, and all together are all of it.
  const auto starts = [](const std::string& line) {
    std::vector<int> columns{1};
    for (std::size_t i = 0; i < line.size(); ++i)
      if (line[i] == ',') columns.push_back(static_cast<int>(i) + 2);
    return columns;
  };
  const auto in_order = [](std::vector<int> columns) {
    std::sort(columns.begin(), columns.end());
    return columns;
  };
  EXPECT_EQ(in_order(numbers(page, "int_at\\(1, ([0-9]+)\\)")), starts(lines[0]));
  EXPECT_NE(page.find("IF int_at(1, 1) <> " + std::to_string(kProtocolVersion) + " THEN"), std::string::npos);
  // The position of a pose from a column on, the angles always from the same columns.
  const auto angles = numbers(page, "real_at\\(row, ([0-9]+)\\)");
  std::vector<int> offsets = numbers(page, "real_at\\(row, first \\+ ([0-9]+)\\)");
  ASSERT_EQ(offsets.size(), 2U);
  ASSERT_NE(page.find("pose.x = real_at(row, first)\n"), std::string::npos);
  offsets.insert(offsets.begin(), 0);
  const auto cut_by = [&](const std::string& calls) {
    std::set<int> columns(angles.begin(), angles.end());
    for (const int first : numbers(page, calls))
      for (const int offset : offsets) columns.insert(first + offset);
    return std::vector<int>(columns.begin(), columns.end());
  };
  EXPECT_EQ(cut_by("pose_to\\(2, ([0-9]+), pr_approach\\)"), starts(lines[1]));
  const auto third = starts(lines[2]);
  EXPECT_EQ(cut_by("pose_to\\(3, ([0-9]+), pr_(?:grasp|retreat)\\)"),
            (std::vector<int>(third.begin(), third.begin() + 9)));
  EXPECT_EQ(numbers(page, "pose_to\\(3, ([0-9]+), pr_retreat\\)"), std::vector<int>{third[6]});
  EXPECT_EQ(numbers(page, "CNV_STR_INT\\(SUB_STR\\(line\\[row\\], column, ([0-9]+)\\)"), std::vector<int>{5});
  EXPECT_EQ(numbers(page, "CNV_STR_REAL\\(SUB_STR\\(line\\[row\\], column, ([0-9]+)\\)"), std::vector<int>{10});
  expect_requests(page, "ask\\('([a-z]+) ?'", kRequests);
}

TEST(RobotDocs, TheKarelProgramsNamesAreShortAndTheirBlocksClosed) {
  const std::string page = read_page("fanuc");
  for (const std::string program : {"bpcomm", "bppose"}) {
    SCOPED_TRACE(program);
    const std::size_t begin = page.find("PROGRAM " + program + "\n"), end = page.find("END " + program + "\n");
    ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
    const std::string code = std::regex_replace(page.substr(begin, end - begin), std::regex{"--[^\n]*|'[^'\n]*'"}, "");
    const std::regex name{"\\b[a-z][a-z_0-9]*\\b"};
    for (std::sregex_iterator it{code.begin(), code.end(), name}, last; it != last; ++it)
      EXPECT_LE(it->str().size(), 12U) << it->str();
    EXPECT_EQ(count(code, "\\bTHEN\\b"), count(code, "\\bENDIF\\b"));
    EXPECT_EQ(count(code, "\\bWHILE\\b"), count(code, "\\bENDWHILE\\b"));
    EXPECT_EQ(count(code, "\\bFOR\\b"), count(code, "\\bENDFOR\\b"));
    EXPECT_EQ(count(code, "\\bROUTINE\\b"), count(code, "\\bEND [a-z_]+"));
  }
}

TEST(RobotDocs, TheTpProgramJumpsToLabelsThatAreThereAndIsNumberedThrough) {
  const std::string page = read_page("fanuc");
  const std::size_t begin = page.find("/PROG  BINPICK\n");
  ASSERT_NE(begin, std::string::npos);
  const std::string program = page.substr(begin, page.find("/END", begin) - begin);
  const auto targets = numbers(program, "(?:JMP |TIMEOUT,)LBL\\[([0-9]+)\\]");
  const auto labels = numbers(program, ":  LBL\\[([0-9]+)(?::[a-z]+)?\\] ;");
  EXPECT_EQ(std::set<int>(targets.begin(), targets.end()), std::set<int>(labels.begin(), labels.end()));
  EXPECT_EQ(std::set<int>(labels.begin(), labels.end()).size(), labels.size()) << "each label once";
  const auto lines = numbers(program, "\n *([0-9]+):  ");
  for (std::size_t i = 0; i < lines.size(); ++i) EXPECT_EQ(lines[i], static_cast<int>(i) + 1);
  const std::regex call{"CALL ([A-Z]+)"};
  for (std::sregex_iterator it{program.begin(), program.end(), call}, last; it != last; ++it)
    EXPECT_NE(page.find("/PROG  " + (*it)[1].str() + "\n"), std::string::npos) << (*it)[1];
}

TEST(RobotDocs, TheAsProgramTakesAsManyNumbersAsAreSent) {
  const std::string page = read_page("kawasaki");
  EXPECT_NE(page.find("IF .count == " + std::to_string(kReplyFields) +
                      " AND bp_f[1] == " + std::to_string(kProtocolVersion) + " THEN"),
            std::string::npos);
  const auto fields = numbers(page, "bp_f\\[([0-9]+)\\](?= == 2|,|\\)|\n)");
  const std::set<int> used(fields.begin(), fields.end());
  for (int field = 7; field <= 21; ++field) EXPECT_TRUE(used.contains(field)) << field;
  EXPECT_LE(*used.rbegin(), static_cast<int>(kReplyFields));
  expect_requests(page, "\\.\\$line = \"([a-z]+) ?\"", kRequests);
}

TEST(RobotDocs, TheAsProgramsOpenAndCloseTheirBlocksAndCallWhatIsThere) {
  const std::string page = read_page("kawasaki");
  std::size_t begin = 0;
  for (const std::size_t expected : {14U, 3U}) {
    begin = page.find("\n.PROGRAM ", begin);
    const std::size_t end = page.find("\n.REALS", begin);
    ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
    std::stringstream code{page.substr(begin, end - begin)};
    begin = end;
    std::set<std::string> programs, called;
    int depth = 0;
    for (std::string line; std::getline(code, line);) {
      line = line.substr(0, line.find(';'));
      std::smatch match;
      if (std::regex_search(line, match, std::regex{"^\\.PROGRAM ([a-z.]+)\\("})) programs.insert(match[1]);
      if (std::regex_search(line, match, std::regex{"^ *CALL ([a-z.]+)"})) called.insert(match[1]);
      if (std::regex_search(line, std::regex{"^ *(IF .* THEN|WHILE .* DO|FOR .* TO .*) *$"})) ++depth;
      if (std::regex_search(line, std::regex{"^ *END *$"})) --depth;
      EXPECT_TRUE(!line.starts_with(".END") || depth == 0) << depth;
      ASSERT_GE(depth, 0) << line;
    }
    for (const std::string& name : called) EXPECT_TRUE(programs.contains(name)) << name;
    for (const std::string& name : programs) EXPECT_LE(name.size(), 15U) << name;
    EXPECT_EQ(programs.size(), expected);
  }
}

TEST(RobotDocs, TheUrProgramOpensAndClosesItsBlocksAndCallsWhatIsThere) {
  const std::string code =
      std::regex_replace(part_of(read_page(), "# binpick: fetch", "\n```"), std::regex{"\"[^\"\n]*\"|#[^\n]*"}, "");
  EXPECT_EQ(count(code, "\n *(def|if|while) .*: *(?=\n)"), count(code, "\n *end *(?=\n|$)"));
  expect_requests(read_page(), "ask\\((?:str_cat\\()?\"([a-z]+) ?\"", kRequests);
  for (const char* name : {"to_path", "along_path", "say_broken", "scan", "pick", "report", "place", "retreat"}) {
    EXPECT_EQ(count(code, (std::string{"\\bdef "} + name + "\\(").c_str()), 1) << name;
    EXPECT_GE(count(code, (std::string{"\\b"} + name + "\\(").c_str()), 2) << name << " is called nowhere";
  }
}

// An answer of another version comes at once: without a pause the program would connect as fast as it can.
TEST(RobotDocs, BackgroundProgramsConnectOnceASecondAtMost) {
  expect_in_order(part_of(read_page("fanuc"), "ROUTINE open_cell", "END open_cell"),
                  {"close_cell", "DELAY 1000", "MSG_CONNECT"});
  expect_in_order(part_of(read_page("kawasaki"), ".PROGRAM bpconn.pc", ".END"), {"TWAIT 1 ", "TCP_CONNECT"});
}

// In along the line, closed, aside to the retreat pose, straight up from there, on record before the arm moves.
TEST(RobotDocs, EachProgramDrawsThePartOutByWayOfTheRetreatPose) {
  expect_in_order(part_of(read_page(), "def pick():", "def to_path"),
                  {"away = p[answer[19], answer[20], answer[21], answer[16], answer[17], answer[18]]",
                   "binpick_open = floor(answer[3])", "movel(approach,", "movel(grasp,", "gripper_close()",
                   "movel(away,", "movel(p[away[0], away[1], above[2], away[3], away[4], away[5]],", "movej(q_clear"});
  const std::string fanuc = read_page("fanuc");
  EXPECT_NE(fanuc.find("pr_retreat = 85\n"), std::string::npos);
  expect_in_order(part_of(fanuc, "LBL[30:pick]", "LBL[35:refuse]"),
                  {"R[88]=R[83]", "PR[84,3]=PR[81,3]+300", "L PR[81] ", "L PR[82] ", "RO[1]=ON", "L PR[85] ",
                   "PR[83]=PR[85]", "PR[83,3]=PR[84,3]", "L PR[83] ", "J P[1]"});
  const std::string as = read_page("kawasaki");
  EXPECT_NE(as.find("POINT bp_away = TRANS(bp_f[19], bp_f[20], bp_f[21], bp_f[16], bp_f[17], bp_f[18])\n"),
            std::string::npos);
  expect_in_order(part_of(as, ".PROGRAM bppick", ".END"),
                  {"bp_open = bp_pick", "LMOVE bp_appro", "LMOVE bp_grasp", "CLOSEI", "LMOVE bp_away",
                   "SHIFT(bp_away BY 0, 0, DZ(.above) - DZ(bp_away))", "LMOVE .out", "JMOVE #bp_clear"});
}

// Fetched, on record, to the start, begin until it may go, along it, end until it is taken, off the record, clear.
TEST(RobotDocs, EachProgramCarriesTheScannerAndKnowsAfterARestartThatItDid) {
  const std::string ur = read_page();
  expect_in_order(
      part_of(ur, "def scan():", "# --- start"),
      {"binpick_scan = floor(answer[3])", "set_clear(False)", "to_path(path)", "while status != 5 and status != 52",
       "\"begin \"", "if status == 5:", "along_path(path)", "while status != 2 and status != 52", "\"end \"",
       "binpick_scan = 0", "say_broken()", "movej(q_clear", "set_clear(True)"});
  expect_in_order(part_of(ur, "# --- start", "# --- the loop"), {"connect()", "if binpick_scan != 0", "say_broken()"});
  expect_in_order(part_of(ur, "# --- the loop", "\n```"), {"ask(\"fetch\")", "elif status == 4:", "scan()"});

  const std::string tp = part_of(read_page("fanuc"), "/PROG  BINPICK\n", "/POS");
  expect_in_order(tp, {"IF R[90]<>0,JMP LBL[60]",
                       "LBL[20:fetch]",
                       "IF R[82]=4,JMP LBL[50]",
                       "LBL[50:scan]",
                       "R[90]=R[83]",
                       "R[91]=R[85]",
                       "DO[1]=OFF",
                       "CALL BPTOPATH",
                       "IF R[91]=0,JMP LBL[60]",
                       "LBL[51:begin]",
                       "R[81]=5",
                       "IF R[82]=5,JMP LBL[53]",
                       "IF R[82]=52,JMP LBL[56]",
                       "JMP LBL[51]",
                       "LBL[53:go]",
                       "CALL BPPATH",
                       "LBL[54:end]",
                       "R[81]=6",
                       "IF R[82]<>2 AND R[82]<>52,JMP LBL[54]",
                       "LBL[56]",
                       "R[90]=0",
                       "J P[1]",
                       "DO[1]=ON",
                       "JMP LBL[20]",
                       "LBL[60:broken]",
                       "R[81]=7",
                       "IF R[82]<>2 AND R[82]<>52,JMP LBL[60]",
                       "R[90]=0",
                       "JMP LBL[10]"});
  const std::string karel = part_of(read_page("fanuc"), "PROGRAM bpcomm\n", "END bpcomm\n");
  expect_in_order(karel, {"IF wanted < 5", "r_open", "ELSE", "r_scan", "CASE (3)", "'done '", "CASE (4)", "'failed '",
                          "CASE (5)", "'begin '", "CASE (6)", "'end '", "CASE (7)", "'broken '"});
  EXPECT_NE(karel.find("r_scan = 90\n"), std::string::npos);

  const std::string as = read_page("kawasaki");
  expect_in_order(part_of(as, ".PROGRAM bpcomm.pc", ".END"),
                  {"bp_cmd == 5", "\"begin \"", "bp_cmd == 6", "\"end \"", "bp_cmd == 7", "\"broken \"", ".status == 4",
                   "bp_asked = bp_f[3]", "bp_path = bp_f[5]", "bp_cmd = 0"});
  expect_in_order(
      part_of(as, ".PROGRAM bpscan", ".END"),
      {"bp_scan = bp_asked", "SIGNAL -1", "CALL bptopath", "CALL bpbroken", "WHILE bp_status <> 5 AND bp_status <> 52",
       "bpcall(5)", "IF bp_status == 5", "CALL bppath", "WHILE bp_status <> 2 AND bp_status <> 52", "bpcall(6)",
       "bp_scan = 0", "JMOVE #bp_clear", "SIGNAL 1"});
  expect_in_order(part_of(as, ".PROGRAM bpstart", ".END"), {"IF bp_scan <> 0", "CALL bpbroken", "IF bp_open <> 0"});
  expect_in_order(part_of(as, ".PROGRAM binpick()", ".END"), {"bpcall(2)", ".status == 4", "CALL bpscan"});
}

TEST(RobotDocs, EachPageNamesTheKeysOfACellWhoseRobotCarriesTheScanner) {
  std::ifstream file{std::string(BINPICK_SOURCE_DIR) + "/config/cell.example.toml"};
  std::stringstream keys;
  keys << file.rdbuf();
  for (const char* make : kPages) {
    const std::string page = read_page(make);
    const std::string section = part_of(page, "When the robot carries the scanner\n", "\n## ");
    const bool is_ur = std::string{make} == "universal-robots";
    for (const std::string key : {"carrier", "T_flange_scanner", "scan_path", "path_timeout_ms", "pose_latency_ms",
                                  is_ur ? "pose_address" : "pose_listen"}) {
      EXPECT_NE(section.find(key), std::string::npos) << make << ": " << key;
      EXPECT_NE(keys.str().find(key + " = "), std::string::npos) << key;
    }
    for (const char* alarm : {"**302,", "**300**", "**303**"})
      EXPECT_NE(section.find(alarm), std::string::npos) << make << ": " << alarm;
    EXPECT_EQ(page.find("of this version"), std::string::npos) << make;
  }
}

namespace {
PoseLine pose_example() {
  PoseLine line{17, 123456, Eigen::Isometry3d::Identity()};
  line.T_base_sent.translation() = Eigen::Vector3d{1234.568, -250, 600};
  line.T_base_sent.linear() = from_wpr_deg({175, -12, -100});
  return line;
}

/// As the controllers write a number: blanks in front up to a width.
std::string padded(double value, int width, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%*.*f", width, decimals, value);
  return text;
}
}  // namespace

TEST(RobotDocs, TheExamplePoseLinesAreThoseOfTheCodec) {
  for (const auto& [make, dialect] : {std::pair{"fanuc", Dialect::Fanuc}, std::pair{"kawasaki", Dialect::Kawasaki}}) {
    const std::string page = read_page(make);
    EXPECT_NE(page.find("\n\n" + as_block(encode(pose_example(), dialect)) + "\n"), std::string::npos) << make;
    EXPECT_NE(page.find("0 … " + std::to_string(kPoseSequences - 1) + ", then 0 again"), std::string::npos) << make;
    EXPECT_EQ(kPoseTimeWrap_ms, 1e7);
    EXPECT_NE(page.find("ms, 0 … 9 999 999, then 0 again"), std::string::npos) << make;
  }
}

TEST(RobotDocs, TheKarelProgramSendsPosesThatAreUnderstood) {
  const std::string page = read_page("fanuc");
  const std::size_t begin = page.find("ROUTINE send_pose"), end = page.find("END send_pose");
  ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
  const std::string code = page.substr(begin, end - begin);
  EXPECT_NE(code.find("line = 'pose'\n"), std::string::npos);
  EXPECT_NE(page.find("wrap_lines = " + std::to_string(kPoseSequences) + "\n"), std::string::npos);
  EXPECT_EQ(numbers(page, "wrap_ticks = ([0-9]+)").at(0) * numbers(page, "tick_ms = ([0-9]+)").at(0), 10'000'000);
  const std::regex added{
      "  add_(int\\(number\\)|int\\(\\(ticks MOD wrap_ticks\\) \\* tick_ms\\)|real\\(pose\\.([xyzwpr]), ([34])\\))"};
  const Eigen::Vector3d wpr = to_wpr_deg(pose_example().T_base_sent.linear());
  const std::map<std::string, double> values{{"x", 1234.568}, {"y", -250},    {"z", 600},
                                             {"w", wpr.x()},  {"p", wpr.y()}, {"r", wpr.z()}};
  std::string line = "pose", order;
  for (std::sregex_iterator it{code.begin(), code.end(), added}, last; it != last; ++it) {
    const std::string axis = (*it)[2];
    order += axis.empty() ? "i" : axis;
    if (axis.empty())
      line += " " + padded(order.size() == 1 ? 17 : 123456, 2, 0);
    else
      line += " " + (" " + padded(values.at(axis), 1, std::stoi((*it)[3])));
  }
  EXPECT_EQ(order, "iixyzwpr");
  const auto read = decode_pose_line(line, Dialect::Fanuc);
  ASSERT_TRUE(read.has_value()) << line << ": " << to_string(read.error());
  EXPECT_EQ(read->time_ms, 123456);
  EXPECT_TRUE(read->T_base_sent.isApprox(pose_example().T_base_sent, 1e-6));
}

TEST(RobotDocs, TheAsProgramSendsPosesThatAreUnderstood) {
  const std::string page = read_page("kawasaki");
  const std::size_t begin = page.find(".PROGRAM bppose.pc"), end = page.find(".END", begin);
  ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
  const std::string code = page.substr(begin, end - begin);
  const auto number_width = numbers(code, "\\$ENCODE\\(/I([0-9]+), \\.number\\)");
  const auto time_width = numbers(code, "\\$ENCODE\\(/F([0-9]+)\\.1, \\.time \\* 1000\\)");
  const auto length_width = numbers(code, "\" \" \\+ \\$ENCODE\\(/F([0-9]+)\\.3, \\.p\\[\\.i\\]\\)");
  const auto angle_width = numbers(code, "\" \" \\+ \\$ENCODE\\(/F([0-9]+)\\.4, \\.p\\[\\.i\\]\\)");
  ASSERT_TRUE(number_width.size() == 1 && time_width.size() == 1 && length_width.size() == 1 &&
              angle_width.size() == 1);
  EXPECT_NE(code.find(".$out[1] = \"pose \" + "), std::string::npos);
  EXPECT_NE(code.find("(.number + 1) MOD " + std::to_string(kPoseSequences)), std::string::npos);
  EXPECT_NE(code.find("IF .time >= 10000 THEN"), std::string::npos);
  const auto line = [&](double number, double time_ms, double length, const Eigen::Vector3d& angles) {
    std::string text = "pose " + padded(number, number_width[0], 0) + padded(time_ms, time_width[0], 1);
    for (int i = 0; i < 3; ++i) text += " " + padded(length, length_width[0], 3);
    for (int i = 0; i < 3; ++i) text += " " + padded(angles[i], angle_width[0], 4);
    return text;
  };
  const Eigen::Vector3d oat = to_oat_deg(pose_example().T_base_sent.linear());
  const auto read = decode_pose_line(line(17, 123456, -250, oat), Dialect::Kawasaki);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->time_ms, 123456);
  EXPECT_TRUE(read->T_base_sent.linear().isApprox(pose_example().T_base_sent.linear(), 1e-5));
  // The widest numbers fit their fields, and there is a blank between all of them.
  const std::string widest = line(9999, 9'999'999.9, -99'998.999, {-180, -180, -180});
  EXPECT_LE(widest.size(), kLineBytesMax);
  EXPECT_EQ(widest.size(), line(0, 0, 0, {0, 0, 0}).size());
  EXPECT_TRUE(decode_pose_line(widest, Dialect::Kawasaki).has_value());
}
}  // namespace binpick::drivers::robot
