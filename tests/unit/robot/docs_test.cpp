#include <algorithm>
#include <fstream>
#include <gtest/gtest.h>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "base/rotation.hpp"
#include "drivers/robot/codec.hpp"

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
  for (const Status status :
       {Status::NotReady, Status::Pick, Status::ReportTaken, Status::Hello, Status::SupplyEmpty, Status::NothingFound,
        Status::NotReachable, Status::Fault, Status::UnknownPick, Status::BadRequest})
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
  const std::size_t list = page.find("answer = [");
  ASSERT_NE(list, std::string::npos);
  const std::string entries = page.substr(list, page.find(']', list) - list);
  EXPECT_EQ(static_cast<std::size_t>(std::count(entries.begin(), entries.end(), ',')), kReplyFields)
      << "count and fields";
}

TEST(RobotDocs, EveryRequestOfTheProgramIsUnderstood) {
  const std::string page = read_page();
  const std::regex call{"ask\\((?:str_cat\\()?\"([a-z]+) ?\""};
  int calls = 0;
  for (std::sregex_iterator it{page.begin(), page.end(), call}, end; it != end; ++it, ++calls) {
    const std::string word = (*it)[1];
    EXPECT_TRUE(decode_request(word == "done" || word == "failed" ? word + " 17" : word)) << word;
  }
  EXPECT_EQ(calls, 4);
}

namespace {
Reply example() {
  Pick pick{17, 118, 2, 11, {}, {}};
  pick.T_base_approach.iso.translation() = Eigen::Vector3d{1234.5678, -250, 600.0004};
  pick.T_base_approach.iso.linear() = from_wpr_deg({175, -12, -100});
  pick.T_base_grasp.iso.translation() = Eigen::Vector3d{1234.5678, -250, 500};
  pick.T_base_grasp.iso.linear() = from_wpr_deg({10, 20, 30});
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
    EXPECT_TRUE(decode_request(word == "done" || word == "failed" ? word + "    17" : word)) << word;
  }
  EXPECT_EQ(words, expected);
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
  const auto reals = numbers(page, "real_at\\(row, ([0-9]+)\\)");
  EXPECT_EQ(reals, starts(lines[1]));
  const auto third = starts(lines[2]);
  EXPECT_EQ(reals, (std::vector<int>(third.begin(), third.begin() + 6)));
  EXPECT_EQ(numbers(page, "CNV_STR_INT\\(SUB_STR\\(line\\[row\\], column, ([0-9]+)\\)"), std::vector<int>{5});
  EXPECT_EQ(numbers(page, "CNV_STR_REAL\\(SUB_STR\\(line\\[row\\], column, ([0-9]+)\\)"), std::vector<int>{10});
  expect_requests(page, "ask\\('([a-z]+) ?'", {"hello", "fetch", "done", "failed"});
}

TEST(RobotDocs, TheKarelProgramsNamesAreShortAndItsBlocksClosed) {
  const std::string page = read_page("fanuc");
  const std::size_t begin = page.find("PROGRAM bpcomm\n"), end = page.find("END bpcomm\n");
  ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
  std::string code = std::regex_replace(page.substr(begin, end - begin), std::regex{"--[^\n]*|'[^'\n]*'"}, "");
  const std::regex name{"\\b[a-z][a-z_0-9]*\\b"};
  for (std::sregex_iterator it{code.begin(), code.end(), name}, last; it != last; ++it)
    EXPECT_LE(it->str().size(), 12U) << it->str();
  const auto count = [&](const char* pattern) {
    const std::regex regex{pattern};
    return std::distance(std::sregex_iterator{code.begin(), code.end(), regex}, std::sregex_iterator{});
  };
  EXPECT_EQ(count("\\bTHEN\\b"), count("\\bENDIF\\b"));
  EXPECT_EQ(count("\\bWHILE\\b"), count("\\bENDWHILE\\b"));
  EXPECT_EQ(count("\\bFOR\\b"), count("\\bENDFOR\\b"));
  EXPECT_EQ(count("\\bROUTINE\\b"), count("\\bEND [a-z_]+"));
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
}

TEST(RobotDocs, TheAsProgramTakesAsManyNumbersAsAreSent) {
  const std::string page = read_page("kawasaki");
  EXPECT_NE(page.find("IF .count == " + std::to_string(kReplyFields) +
                      " AND bp_f[1] == " + std::to_string(kProtocolVersion) + " THEN"),
            std::string::npos);
  const auto fields = numbers(page, "bp_f\\[([0-9]+)\\](?= == 1|,|\\)|\n)");
  const std::set<int> used(fields.begin(), fields.end());
  for (int field = 7; field <= 18; ++field) EXPECT_TRUE(used.contains(field)) << field;
  EXPECT_LE(*used.rbegin(), static_cast<int>(kReplyFields));
  expect_requests(page, "\\.\\$line = \"([a-z]+) ?\"", {"hello", "fetch", "done", "failed"});
}

TEST(RobotDocs, TheAsProgramsOpenAndCloseTheirBlocksAndCallWhatIsThere) {
  const std::string page = read_page("kawasaki");
  const std::size_t begin = page.find("\n.PROGRAM "), end = page.find("\n.REALS", begin);
  ASSERT_TRUE(begin != std::string::npos && end != std::string::npos);
  std::stringstream code{page.substr(begin, end - begin)};
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
  EXPECT_EQ(programs.size(), 10U);
}
}  // namespace binpick::drivers::robot
