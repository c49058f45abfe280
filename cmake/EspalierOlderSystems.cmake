# espalier_older_systems(target): what goes into wheels (python/wheel.sh) runs on systems older than this one. Not with
# sanitizers, which look into these calls; a compiler that links its C++ library statically has no older versions of symbols.
set(older_systems ${CMAKE_CURRENT_LIST_DIR}/older_systems)
set(wrap_newer_symbols -Wl,--wrap=hypot -Wl,--wrap=_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE)
if(CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64 AND NOT ESPALIER_SANITIZE)
  try_compile(has_older_symbols SOURCES ${older_systems}/symbols.c ${older_systems}/check.cpp LINK_OPTIONS ${wrap_newer_symbols})
endif()
function(espalier_older_systems target)
  if(has_older_symbols)
    target_sources(${target} PRIVATE ${older_systems}/symbols.c)
    target_link_options(${target} PRIVATE ${wrap_newer_symbols})
  endif()
endfunction()
