#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <gtest/gtest.h>
#include <sstream>

#include "tests/unit/config/cell_files.hpp"
#include "tools/commands.hpp"

namespace binpick::tools {
namespace {
struct Answer {
  int exit_status = 0;
  std::string out, err;
};
Answer export_plc(std::vector<std::string> arguments) {
  CLI::App app;
  Answer answer;
  add_export(app, answer.exit_status);
  arguments.insert(arguments.begin(), {"export", "plc"});
  std::ranges::reverse(arguments);  // CLI11 takes them from the back
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  app.parse(arguments);
  answer.out = testing::internal::GetCapturedStdout();
  answer.err = testing::internal::GetCapturedStderr();
  return answer;
}

TEST(ExportCommand, WritesWhatItSaysIntoAFolderThatItMakes) {
  const config::CellFolder folder;
  const std::string out = folder.path("plc/logix");
  const Answer answer = export_plc({"--for", "logix", "--out", out});
  EXPECT_EQ(answer.exit_status, 0) << answer.err;
  std::istringstream lines{answer.out};
  std::size_t files = 0;
  for (std::string line; std::getline(lines, line); ++files) EXPECT_FALSE(config::read_text(line).empty()) << line;
  EXPECT_EQ(files, 6U);
}

TEST(ExportCommand, TakesPortAndTimeOutsFromTheCellFile) {
  const config::CellFolder folder;
  ASSERT_TRUE(folder.load().has_value());
  const Answer answer =
      export_plc({"--for", "s7", "--out", folder.path("."), "--cell", folder.path("cell.toml"), "--host", "10.0.0.7"});
  ASSERT_EQ(answer.exit_status, 0) << answer.err;
  const std::string scl = config::read_text(folder.path("BinPick.scl"));
  EXPECT_NE(scl.find("connect.RemoteAddress.ADDR[1] := 10;"), std::string::npos);
  EXPECT_NE(scl.find("connect.RemotePort := 502;"), std::string::npos);
  EXPECT_NE(scl.find("ur: m, rotation vector in rad"), std::string::npos);
}

TEST(ExportCommand, AHostThatWouldStandNowhereIsWrongInput) {
  const Answer answer = export_plc({"--for", "logix", "--host", "10.0.0.7"});
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_TRUE(answer.err.starts_with("binpick export: --host is for s7, ")) << answer.err;
}

TEST(ExportCommand, ACellFileForTheOtherMakeIsWrongInput) {
  const config::CellFolder folder;
  ASSERT_TRUE(folder.load().has_value());
  const Answer answer =
      export_plc({"--for", "logix", "--out", folder.path("none"), "--cell", folder.path("cell.toml")});
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_EQ(answer.err, "binpick export: " + folder.path("cell.toml") +
                            ": plc.word_order is \"s7\", which a PLC programmed for logix would read wrongly; write "
                            "word_order = \"logix\" there, or export --for s7\n");
  EXPECT_FALSE(std::filesystem::exists(folder.path("none")));
}

TEST(ExportCommand, TheRoleIsTheCellFilesOrNamed) {
  config::CellFolder folder;
  folder.edit("role = \"server\"", "role = \"client\"").edit("listen = \"0.0.0.0:502\"", "");
  folder.edit("address = \"\"", "address = \"192.168.0.10:1502\"");
  ASSERT_TRUE(folder.load().has_value()) << folder.findings();
  const auto scl = [&] { return config::read_text(folder.path("BinPick.scl")); };
  Answer answer = export_plc({"--for", "s7", "--out", folder.path("."), "--cell", folder.path("cell.toml")});
  ASSERT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_NE(scl().find("connect.LocalPort := 1502;"), std::string::npos);
  EXPECT_NE(scl().find("connect.RemoteAddress.ADDR[4] := 20;"), std::string::npos) << "plc.address is the PLC's own";
  answer =
      export_plc({"--for", "s7", "--role", "server", "--out", folder.path("none"), "--cell", folder.path("cell.toml")});
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_EQ(answer.err, "binpick export: " + folder.path("cell.toml") +
                            ": plc.role is \"client\"; write role = \"server\" there, or leave --role server out\n");
  answer = export_plc({"--for", "s7", "--role", "client", "--out", folder.path(".")});
  ASSERT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_NE(scl().find("MB_SERVER"), std::string::npos);
}

TEST(ExportCommand, WrongInputIsOneLine) {
  for (const char* host : {"10.0.0", "10.0.0.256", "10.0.0.1.2", "cell", "1.2.3.4 "}) {
    const Answer answer = export_plc({"--for", "s7", "--host", host});
    EXPECT_EQ(answer.exit_status, 2);
    EXPECT_EQ(answer.err, "binpick export: --host " + std::string(host) +
                              ": is no IPv4 address; give the cell controller's, like 192.168.0.20\n");
  }
  CLI::App app;
  int exit_status = 0;
  add_export(app, exit_status);
  EXPECT_THROW(app.parse(std::vector<std::string>{"s5", "--for", "plc", "export"}), CLI::ParseError);
}
}  // namespace
}  // namespace binpick::tools
