# Of the library that another build may take (cmake/EspalierFrom.cmake): it is taken where sources, options and the file
# itself are those of its origin, and else it is said what differs.   cmake -Droot=<repository> -Dwork=<folder> -P origin_test.cmake
cmake_minimum_required(VERSION 3.25)
list(APPEND CMAKE_MODULE_PATH ${root}/cmake)
include(source_hash)
set(ESPALIER_FROM off)
include(EspalierFrom)

set(failed 0)
macro(expect what wanted)
  if(NOT "${${what}}" MATCHES "${wanted}")
    message(SEND_ERROR "'${${what}}' is not '${wanted}'")
  endif()
endmacro()

file(REMOVE_RECURSE ${work})
set(PROJECT_SOURCE_DIR ${work}/sources)
set(library ${work}/libespalier.a)
file(WRITE ${work}/sources/src/deep/a.cpp "int a;\n")
file(WRITE ${work}/sources/include/a.h "int a;\n")
file(WRITE ${work}/sources/cmake/EspalierModule.cmake "\n")
file(WRITE ${work}/sources/docs/page.md "text\n")
file(WRITE ${library} "objects")
set(ESPALIER_ORIGIN "compiler: GNU 12;2 [x]\nflags: -O3 -DA=\"b c\"\nCUDA: OFF\n")
file(WRITE ${work}/words "${ESPALIER_ORIGIN}")

# What the build does: the hash before, the library, the hash after.
function(note result)
  execute_process(COMMAND ${CMAKE_COMMAND} -Droot=${PROJECT_SOURCE_DIR} -Dtext=${work}/words -Doutput=${work}/before
    -P ${root}/cmake/source_hash.cmake COMMAND_ERROR_IS_FATAL ANY)
  if(ARGN)
    file(WRITE ${ARGN} "edited during the build\n")
  endif()
  execute_process(COMMAND ${CMAKE_COMMAND} -Droot=${PROJECT_SOURCE_DIR} -Dtext=${work}/words -Doutput=${work}/origin
    -Dbefore=${work}/before -Dlibrary=${library} -P ${root}/cmake/source_hash.cmake RESULT_VARIABLE code OUTPUT_VARIABLE said)
  set(${result} "${code} ${said}" PARENT_SCOPE)
endfunction()

note(said)
expect(said "^0 $")
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^$")
file(WRITE ${work}/sources/docs/page.md "other text\n")  # not compiled
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^$")

# Sources: edited, new, moved; taken back they fit again.
file(WRITE ${work}/sources/src/deep/a.cpp "int b;\n")
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^it was made of other sources")
espalier_compare_origin(${work}/origin "" why)  # without the hashes
expect(why "^$")
file(WRITE ${work}/sources/src/deep/a.cpp "int a;\n")
file(WRITE ${work}/sources/include/b.h "")
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^it was made of other sources")
file(REMOVE ${work}/sources/include/b.h)
file(RENAME ${work}/sources/src/deep/a.cpp ${work}/sources/src/a.cpp)
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^it was made of other sources")
file(RENAME ${work}/sources/src/a.cpp ${work}/sources/src/deep/a.cpp)
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^$")

# The library: another one, none.
file(WRITE ${library} "other objects")
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^${library} is not the file that was made with it$")
file(REMOVE ${library})
espalier_compare_origin(${work}/origin ${library} why)
expect(why "is not there$")
file(WRITE ${library} "objects")

# Options: each difference is told, with both values.
set(ESPALIER_ORIGIN "compiler: GNU 13\nflags: -O3 -DA=\"b c\"\nCUDA: ON\n")
espalier_compare_origin(${work}/origin ${library} why)
expect(why "compiler: GNU 12,2 .x.' where 'compiler: GNU 13' is wanted.*CUDA: OFF' where 'CUDA: ON'")
if(why MATCHES "flags")
  message(SEND_ERROR "what is the same is told: ${why}")
endif()

# A source that is edited during the build leaves no origin at all.
note(said ${work}/sources/include/a.h)
expect(said "A source was edited during the build")
if(EXISTS ${work}/origin)
  message(SEND_ERROR "the origin is still there")
endif()
espalier_compare_origin(${work}/origin ${library} why)
expect(why "^a source was edited while it was built$")
file(REMOVE_RECURSE ${work})
