# The origin of a compiled library: what it was made from and how, in a text file beside it (espalier.origin). Who wants
# to link the library from another build (EspalierFrom.cmake) makes the same text of its own sources and options, and
# takes the library only where the two are the same.
include(source_hash)

# ESPALIER_ORIGIN: the text of this build, but for the hash of the sources.
string(TOUPPER "${CMAKE_BUILD_TYPE}" type)
get_filename_component(compiler "${CMAKE_CXX_COMPILER}" REALPATH)
set(cuda none)
if(ESPALIER_CUDA)
  set(cuda "${CMAKE_CUDA_COMPILER_VERSION}")
endif()
set(kind static)
if(BUILD_SHARED_LIBS)
  set(kind shared)
endif()
string(CONCAT ESPALIER_ORIGIN
  "version: ${PROJECT_VERSION}\n"
  "compiler: ${compiler} ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}\n"
  "processor: ${CMAKE_SYSTEM_PROCESSOR}\n"
  "build type: ${CMAKE_BUILD_TYPE}\n"
  "flags: ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${type}} ${CMAKE_INTERPROCEDURAL_OPTIMIZATION}\n"
  "libraries: fmt ${fmt_VERSION}, pugixml ${pugixml_VERSION}, Eigen ${Eigen3_VERSION}, Highway in ${HWY_INCLUDE_DIR}, zlib ${ZLIB_VERSION_STRING}\n"
  "CUDA: ${cuda}\n"
  "sanitizers: ${ESPALIER_SANITIZE}\n"
  "kind: ${kind}\n")
string(REGEX REPLACE " +\n" "\n" ESPALIER_ORIGIN "${ESPALIER_ORIGIN}")

# The file beside espalier_library, by target espalier_origin. The sources are hashed before the first of them is compiled
# and once more when the library has been made: where one was edited in between there is no file.
function(espalier_write_origin)
  set(words ${PROJECT_BINARY_DIR}/generated/origin.txt)
  set(now ${PROJECT_BINARY_DIR}/generated/espalier.origin)
  file(CONFIGURE OUTPUT ${words} CONTENT "${ESPALIER_ORIGIN}" @ONLY)
  file(GLOB_RECURSE files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/* ${PROJECT_SOURCE_DIR}/include/*
    ${PROJECT_SOURCE_DIR}/cmake/Espalier*.cmake)
  add_custom_command(OUTPUT ${now} COMMAND ${CMAKE_COMMAND} -Droot=${PROJECT_SOURCE_DIR} -Dtext=${words} -Doutput=${now}
    -P ${PROJECT_SOURCE_DIR}/cmake/source_hash.cmake
    DEPENDS ${files} ${words} ${PROJECT_SOURCE_DIR}/cmake/source_hash.cmake COMMENT "Hashing the sources" VERBATIM)
  add_custom_target(espalier_sources DEPENDS ${now})
  add_dependencies(espalier_base espalier_sources)  # the lowest module: nothing is compiled before
  set(made ${CMAKE_CURRENT_BINARY_DIR}/espalier.origin)
  add_custom_command(OUTPUT ${made} COMMAND ${CMAKE_COMMAND} -Droot=${PROJECT_SOURCE_DIR} -Dtext=${words} -Doutput=${made}
    -Dbefore=${now} -Dlibrary=$<TARGET_FILE:espalier_library> -P ${PROJECT_SOURCE_DIR}/cmake/source_hash.cmake DEPENDS ${now} espalier_library
    COMMENT "Noting what the library was made of" VERBATIM)
  add_custom_target(espalier_origin ALL DEPENDS ${made})
endfunction()
