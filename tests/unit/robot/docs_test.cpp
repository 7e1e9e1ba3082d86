#include <algorithm>
#include <fstream>
#include <gtest/gtest.h>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "drivers/robot/codec.hpp"

namespace binpick::drivers::robot {
namespace {
std::string read_page() {
  std::ifstream file{std::string(BINPICK_SOURCE_DIR) + "/docs/robots/universal-robots.md"};
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}
}  // namespace

// The page is what integrators program from: its numbers are those of the code.
TEST(RobotDocs, EveryStatusStandsInTheTable) {
  const std::string page = read_page();
  const std::size_t table = page.find("| status | says |");
  ASSERT_NE(table, std::string::npos);
  std::set<int> written;
  const std::string rows = page.substr(table, page.find("\n\n", table) - table);
  const std::regex row{"\n\\| ([0-9]+) \\|"};
  for (std::sregex_iterator it{rows.begin(), rows.end(), row}, end; it != end; ++it)
    written.insert(std::stoi((*it)[1]));
  std::set<int> known;
  for (const Status status :
       {Status::NotReady, Status::Pick, Status::ReportTaken, Status::Hello, Status::SupplyEmpty, Status::NothingFound,
        Status::NotReachable, Status::Fault, Status::UnknownPick, Status::BadRequest})
    known.insert(static_cast<int>(status));
  EXPECT_EQ(written, known);
}

TEST(RobotDocs, TheProgramReadsAsManyNumbersAsAreSent) {
  const std::string page = read_page();
  EXPECT_NE(page.find("socket_read_ascii_float(" + std::to_string(kReplyFields) + ", \"binpick\""), std::string::npos);
  EXPECT_NE(page.find("good = answer[0] == " + std::to_string(kReplyFields)), std::string::npos);
  EXPECT_NE(page.find("at most " + std::to_string(kLineBytesMax) + " characters"), std::string::npos);
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
}  // namespace binpick::drivers::robot
