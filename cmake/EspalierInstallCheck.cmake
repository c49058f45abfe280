# After a build of some targets only, `cmake --install` says what is missing before it copies anything. To be included
# before whatever installs something.
set(hosts "")
if(ESPALIER_HOSTS)
  set(hosts espalier_hosts)
endif()
install(CODE "
foreach(file \"$<TARGET_FILE:espalier_library>\" \"$<TARGET_FILE:espalier_cli>\" $<$<BOOL:${ESPALIER_HOSTS}>:\"$<TARGET_FILE:espalier_host_hsl>\">)
  if(NOT EXISTS \"\${file}\")
    message(FATAL_ERROR \"\${file} is not built. Build it first: cmake --build ${PROJECT_BINARY_DIR} --target espalier_library espalier_cli ${hosts}\")
  endif()
endforeach()")
