# Writes OUT: the commit that the sources are at, and what was changed since. Run at every build; OUT changes only when
# the answer does.
cmake_policy(VERSION 3.25)
execute_process(COMMAND git -c safe.directory=* rev-parse --short=12 HEAD WORKING_DIRECTORY ${SOURCE}
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
execute_process(COMMAND git -c safe.directory=* diff HEAD -- base vision tests/emulators bench/scenes CMakeLists.txt
  WORKING_DIRECTORY ${SOURCE} OUTPUT_VARIABLE changes ERROR_QUIET)
if(NOT commit)
  set(commit unknown)
endif()
if(changes)
  string(SHA1 hash "${changes}")
  string(SUBSTRING ${hash} 0 8 hash)
  set(commit "${commit}+${hash}")
endif()
file(CONFIGURE OUTPUT ${OUT} @ONLY CONTENT "#include \"bench/scenes/commit.hpp\"

namespace binpick::bench {
const char* const kCommit = \"@commit@\";
}  // namespace binpick::bench
")
