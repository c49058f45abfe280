# espalier_older_systems(target): what goes into wheels (python/wheel.sh) runs on systems older than this one. Not with
# sanitizers, which look into these calls; a compiler that links its C++ library statically has no older versions of symbols.
set(older_systems ${CMAKE_CURRENT_LIST_DIR}/older_systems)
set(wrap_newer_symbols -Wl,--wrap=hypot -Wl,--wrap=_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE)
if(CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64 AND NOT ESPALIER_SANITIZE)
  # As a program and as a module, with the options of both: one compiler (its own libstdc++, Ubuntu 24.04) could do the first alone.
  try_compile(older_in_programs SOURCES ${older_systems}/symbols.c ${older_systems}/check.cpp LINK_OPTIONS ${wrap_newer_symbols})
  try_compile(older_in_modules SOURCES ${older_systems}/symbols.c ${older_systems}/check.cpp
    CMAKE_FLAGS -DCMAKE_POSITION_INDEPENDENT_CODE=ON
    LINK_OPTIONS -shared -Wl,-z,defs -Wl,--as-needed -Wl,--gc-sections ${wrap_newer_symbols})
  if(older_in_programs AND older_in_modules)
    set(has_older_symbols ON)
  endif()
endif()
function(espalier_older_systems target)
  if(has_older_symbols)
    target_sources(${target} PRIVATE ${older_systems}/symbols.c)
    target_link_options(${target} PRIVATE ${wrap_newer_symbols})
  endif()
endfunction()
