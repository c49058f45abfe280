cmake_minimum_required(VERSION 3.25)
# Run at build time: writes `git describe` of `source` as a C++ header to `output`, touching it only when it changes.
execute_process(COMMAND git -C ${source} describe --always --dirty --abbrev=12
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${output} CONTENT "#define ESPALIER_COMMIT \"@commit@\"\n" @ONLY)
