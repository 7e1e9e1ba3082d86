#include "config/document.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/unit/config/cell_files.hpp"

namespace binpick::config {
namespace {
std::string findings(const Document& document) {
  std::string text;
  for (const auto& d : document.findings)
    text += std::to_string(d.line) + ":" + std::to_string(d.column) + ": " + d.message + "\n";
  return text;
}

struct Slip {
  const char* text;
  const char* finding;
};
class Syntax : public testing::TestWithParam<Slip> {};
TEST_P(Syntax, SaysWhereAndWhatToDo) { EXPECT_EQ(findings(parse("a.toml", GetParam().text)), GetParam().finding); }
INSTANTIATE_TEST_SUITE_P(
    All, Syntax,
    testing::Values(
        Slip{"a = lms400\n",
             "1:5: this is no TOML value; put a text in \"quotes\", write a number as 1.5, a flag as true or false\n"},
        Slip{"a = 1,5\n",
             "1:6: key-value pair: expected a comment or whitespace, saw ','; write decimals with a point, 1.5, "
             "and lists in [ ]\n"},
        Slip{"a: 3\n", "1:2: key-value pair: expected '=', saw ':'; write name = value\n"},
        Slip{"a = 1\na = 2\n", "2:5: key-value pair: cannot redefine existing integer 'a'; remove one of the two\n"},
        Slip{"[a]\nb=1\n[a]\nc=2\n",
             "3:1: table header: cannot redefine existing table 'a'; put its keys under the first one\n"},
        Slip{"[[a]]\n[a]\n",
             "2:1: table header: cannot redefine existing array 'a' as table; write it in double brackets, "
             "[[…]], as the others are\n"},
        Slip{"a = 192.168.0.1\n",
             "1:12: floating-point: expected decimal digit or exponent, saw '.'; write a number as 1.5, "
             "and an address or a name in \"quotes\"\n"},
        Slip{"a = 007\n", "1:8: decimal integer: leading zeroes are prohibited; write the number without them\n"},
        Slip{"a = \"C:\\qa\"\n",
             "1:9: string: unknown escape sequence '\\q'; write \\\\ for one backslash, or put the text in "
             "'single quotes'\n"},
        Slip{"a = { b = [0, 0,} }\n",
             "1:17: this is no TOML value; put a text in \"quotes\", write a number as 1.5, a flag as true or false\n"},
        Slip{"a = True\n", "1:5: boolean: expected 'true', saw 'T'; write true or false\n"},
        Slip{"a =\n", "1:4: key-value pair: expected value, saw '\\n'; write a value after the =\n"}));

TEST(Document, ALineWithASlipIsSkippedAndTheRestIsRead) {
  const Document document = parse("a.toml", "[s]\nx = yes\ny = 2\nz = \"open\nw = 3\n");
  EXPECT_TRUE(document.usable);
  EXPECT_EQ(document.findings.size(), 2U) << findings(document);
  EXPECT_TRUE(document.damaged_keys.contains("x"));
  EXPECT_TRUE(document.damaged_keys.contains("z"));
  const Member* s = document.root.find("s");
  ASSERT_NE(s, nullptr);
  EXPECT_EQ(s->value.find("y")->value.integer, 2);
  EXPECT_EQ(s->value.find("w")->value.integer, 3);
  EXPECT_EQ(s->value.find("y")->value.place.line, 3);
  EXPECT_EQ(s->value.find("y")->value.place.column, 5);
}

TEST(Document, ByteOrderMarkAndCrLfAreNoMistake) {
  const Document document = parse("a.toml", "\xEF\xBB\xBF# first\r\nx = 1\r\ny = \"ä\" # é\r\nz = 900\r\n");
  EXPECT_EQ(findings(document), "");
  EXPECT_EQ(document.root.find("x")->value.place.line, 2);
  EXPECT_EQ(document.lines[3], "z = 900");
  EXPECT_EQ(document.root.find("y")->value.place.length, 3) << "characters, not bytes";
}

TEST(Document, OtherEncodingsAreRefusedWithARemedy) {
  EXPECT_EQ(findings(parse("a",
                           "\xFF\xFEx\0=\0"
                           "1\0")),
            "0:1: is UTF-16 text; save it as UTF-8\n");
  EXPECT_EQ(findings(parse("a", "x = 1\nname = \"K\xE4ltemaschine\"\n")),
            "2:10: byte 0xE4 is not UTF-8; save the file as UTF-8\n");
  // Overlong '/', a surrogate, beyond the last code point, a sequence cut off by the end.
  for (const char* bad : {"\xC0\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82"})
    EXPECT_EQ(parse("a", std::string{"x = '"} + bad + "'").findings.size(), 1U) << bad;
}

TEST(Document, WhatWouldNestWithoutEndIsRefused) {
  std::string deep = "a";
  for (int i = 0; i < 50'000; ++i) deep += ".a";
  EXPECT_EQ(findings(parse("a", deep + " = 1\n")), "1:32: key of more than 16 names; keys here have at most three\n");
  EXPECT_EQ(findings(parse("a", "[" + deep + "]\n")),
            "1:33: key of more than 16 names; keys here have at most three\n");
  EXPECT_FALSE(parse("a", "x = " + std::string(100'000, '[')).findings.empty());
  std::string tables = "x = ";
  for (int i = 0; i < 20'000; ++i) tables += "{a=";
  EXPECT_FALSE(parse("a", tables).findings.empty());
  EXPECT_EQ(findings(parse("a", "x = '1.2.3.4.5.6.7.8.9.1.2.3.4.5.6.7.8' # a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a\n")),
            "");
}

TEST(Document, FilesThatAreNone) {
  const CellFolder folder;
  const auto finding = [](const std::string& path) {
    const Document document = open(path);
    EXPECT_FALSE(document.usable);
    return document.findings.size() == 1 ? to_string(document.findings.front()) : "not one finding";
  };
  EXPECT_EQ(
      finding(folder.path("none.toml")),
      folder.path("none.toml") + ": cannot be opened: No such file or directory; check the path and who may read it");
  EXPECT_EQ(finding(folder.path("")), folder.path("") + ": is a directory; name the file in it");
  EXPECT_EQ(finding("/dev/null"), "/dev/null: is not a regular file; name a TOML file");
  EXPECT_EQ(finding("/dev/zero"), "/dev/zero: is not a regular file; name a TOML file");
  ASSERT_EQ(mkfifo(folder.path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(finding(folder.path("pipe")), folder.path("pipe") + ": is not a regular file; name a TOML file");
  folder.write("big.toml", std::string(10'000'000, '#'));
  EXPECT_EQ(finding(folder.path("big.toml")),
            folder.path("big.toml") + ": has 9765 KiB, more than 256 KiB; is it the right file?");
}

TEST(Document, AnEmptyFileIsReadAndLacksEverything) {
  const CellFolder folder;
  folder.write("empty.toml", "");
  const auto loaded = load(folder.path("empty.toml"));
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().size(), 4U);
}

TEST(Findings, TheCaretStandsUnderTheValue) {
  Diagnostic d{"cell.toml",
               41,
               23,
               3,
               "scanner.frequency_hz = 900 is outside 150 … 500; use at most 500",
               "profiles_per_second = 900"};
  EXPECT_EQ(to_string(d),
            "cell.toml:41:23: scanner.frequency_hz = 900 is outside 150 … 500; use at most 500\n"
            "  41 | profiles_per_second = 900\n"
            "     |                       ^~~");
  d.source = "\tä\x1B[31m = 900";
  d.column = 3;
  d.length = 40;
  EXPECT_EQ(to_string(d),
            "cell.toml:41:3: scanner.frequency_hz = 900 is outside 150 … 500; use at most 500\n"
            "  41 |  ä?[31m = 900\n"
            "     |   ^~~~~~~~~~~");
}

TEST(Findings, ALongLineIsShownAroundTheCaret) {
  Diagnostic d{"a.toml", 1, 5000, 4, "m; r", std::string(4999, 'x') + "here" + std::string(5000, 'y')};
  const std::string text = to_string(d);
  EXPECT_LT(text.size(), 400U);
  const auto lines = [&] {
    std::vector<std::string> all;
    std::istringstream stream{text};
    for (std::string line; std::getline(stream, line);) all.push_back(line);
    return all;
  }();
  ASSERT_EQ(lines.size(), 3U);
  // The ellipsis is one character of three bytes.
  EXPECT_EQ(lines[1].find("here") - 2, lines[2].find('^'));
}

TEST(Findings, NearestWord) {
  const std::vector<std::string> keys{"tilt_max_deg", "listen", "allow", "threads"};
  EXPECT_EQ(nearest("tilt_max", keys), "tilt_max_deg");
  EXPECT_EQ(nearest("tilt_max_degrees", keys), "tilt_max_deg");
  EXPECT_EQ(nearest("lisetn", keys), "listen");
  EXPECT_EQ(nearest("Threads", keys), "threads");
  EXPECT_EQ(nearest("colour", keys), "");
  EXPECT_EQ(nearest("", keys), "");
}
}  // namespace
}  // namespace binpick::config
