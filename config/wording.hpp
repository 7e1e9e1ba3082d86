#pragma once

#include <string>

#include "config/keys.hpp"

/// What the key table says, in words: for findings, the example files and the reference.
namespace binpick::config {
std::string number_text(double value);            ///< Shortest text that reads back the same.
std::string range_text(const KeyFacts& facts);    ///< "1 … 600".
std::string choices_text(const KeyFacts& facts);  ///< "\"s7\", \"logix\"".
std::string type_text(const KeyFacts& facts);     ///< "whole number", "text" …
std::string example_text(const KeyFacts& facts);  ///< A good value, as it stands in a file.

std::string example_cell();  ///< config/cell.example.toml.
std::string example_part();  ///< config/part.example.toml.
std::string reference();     ///< docs/configuration.md.
}  // namespace binpick::config
