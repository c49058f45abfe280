# Runs at install time of the component `bundle` with `binaries` set: copies the shared libraries that they need into
# lib/espalier and the licences of the packages that they come from into share/doc/espalier/third-party.
# Left out: glibc, which cannot be carried along, and libstdc++ and libgcc_s, which every distribution installs with it
# and where a second, older copy would break other libraries of the process.
file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${binaries}
  RESOLVED_DEPENDENCIES_VAR libraries UNRESOLVED_DEPENDENCIES_VAR missing
  PRE_EXCLUDE_REGEXES "^ld-linux" "^lib(c|m|dl|rt|pthread|stdc\\+\\+|gcc_s)\\.so" "^libcuda\\.so" "^lib[atl]san\\.so" "^libubsan\\.so")
if(missing)
  message(FATAL_ERROR "the bundle lacks libraries that were not found: ${missing}")
endif()
set(root "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}")
find_program(DPKG dpkg)
foreach(library IN LISTS libraries)
  file(INSTALL ${library} DESTINATION ${CMAKE_INSTALL_PREFIX}/lib/espalier FOLLOW_SYMLINK_CHAIN)
  if(DPKG)
    file(REAL_PATH ${library} real)
    string(REGEX REPLACE "^/usr" "" unmerged ${real})  # packages from before /lib became a link know the short path
    execute_process(COMMAND ${DPKG} -S ${real} ${unmerged} OUTPUT_VARIABLE owner ERROR_QUIET)
    string(REGEX REPLACE "[: ].*" "" package "${owner}")
    if(package AND EXISTS /usr/share/doc/${package}/copyright)
      file(MAKE_DIRECTORY ${root}/share/doc/espalier/third-party)
      configure_file(/usr/share/doc/${package}/copyright ${root}/share/doc/espalier/third-party/${package}.txt COPYONLY)
    endif()
  endif()
endforeach()
