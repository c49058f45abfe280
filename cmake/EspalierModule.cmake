# espalier_module(name FOLDER folder SUBFOLDERS names... GENERATED sources... DEPENDS other modules... LIBRARIES external targets...)
# One static library espalier_<name> per folder src/<folder> (by default src/<name>), made of all sources in that folder and
# in the sub-folders that SUBFOLDERS names; or, with GENERATED, of these sources alone.
# A build from nothing compiles them together, unless APART is given. COLD and HOT: espalier_cold(). WARM: all at -O2.
# A module sees the headers of the modules below it as "module/header.hpp".
cmake_host_system_information(RESULT memory QUERY TOTAL_PHYSICAL_MEMORY)  # MB
cmake_host_system_information(RESULT cores QUERY NUMBER_OF_LOGICAL_CORES)
math(EXPR memory_per_core "${memory} / ${cores}")
function(espalier_flags target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow -Wno-unknown-pragmas>
    $<$<AND:$<BOOL:${ESPALIER_WERROR}>,$<COMPILE_LANGUAGE:CXX>>:-Werror>)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-restrict>)  # false alarms: GCC bug 105651
  endif()
  if(ESPALIER_FROM_SCRATCH AND CMAKE_CXX_COMPILER_ID STREQUAL GNU AND memory_per_core GREATER 3500)
    # GCC collects its garbage from 128 MB on, which takes a sixth of its time in large sources; it may have 2 GB.
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=2000000>)
  endif()
  if(ESPALIER_SANITIZE)
    target_compile_definitions(${target} PRIVATE ESPALIER_SANITIZED)  # clang has no macro of its own
    target_compile_options(${target} PUBLIC -fsanitize=${ESPALIER_SANITIZE} -fno-omit-frame-pointer -g1)
    if(CMAKE_CXX_COMPILER_ID MATCHES Clang)
      target_compile_options(${target} PUBLIC -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/sanitizer_ignore.txt)
    endif()
    target_link_options(${target} PUBLIC -fsanitize=${ESPALIER_SANITIZE})
  endif()
  # What guides the fuzzers, in the readers and in what checks input. Elsewhere it would only cost: a compile of kernels
  # takes 1.4 times as long with it.
  if(ESPALIER_FUZZERS AND target MATCHES "^(fuzz_.*|espalier_(base|matrix|analysis|solver|c|fmi))$")
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
endfunction()

# What is not hot is compiled with -O1 in a release build: it takes half the time of -O3, and the loops over entries,
# elements and tiles stand in few sources. Those are given as HOT (-O2: GCC makes vectors and inlines).
# espalier_cold(target HOT sources...), before its sources are compiled together
function(espalier_cold target)
  cmake_parse_arguments(ARG "" "" "HOT" ${ARGN})
  target_compile_options(${target} PRIVATE $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CONFIG:Release>>:-O1>)
  if(ARG_HOT)
    set_property(SOURCE ${ARG_HOT} APPEND PROPERTY COMPILE_OPTIONS $<$<CONFIG:Release>:-O2>)
  endif()
endfunction()

# Reads headers of libraries, which take most of the time of small sources, once for a target (ESPALIER_FROM_SCRATCH), or
# takes what another target with the same options has read. Sources with options of their own other than -O are left out:
# their compiler would refuse what others have read.
# espalier_precompile(target [FROM other target] headers...)
function(espalier_precompile target)
  cmake_parse_arguments(ARG "" "FROM" "" ${ARGN})
  if(NOT ESPALIER_FROM_SCRATCH OR NOT TARGET ${target})
    return()
  endif()
  if(ARG_FROM STREQUAL "espalier_base" AND ESPALIER_FUZZERS)  # which is compiled with what guides the fuzzers; others are not
    return()
  endif()
  if(ARG_FROM)
    target_precompile_headers(${target} REUSE_FROM ${ARG_FROM})
  else()
    target_precompile_headers(${target} PRIVATE ${ARG_UNPARSED_ARGUMENTS})
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)  # forgets that what it has read came from the system: false alarms there
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-array-bounds -Wno-stringop-overflow
      -Wno-stringop-overread -Wno-subobject-linkage -Wno-free-nonheap-object
      -Wno-error=invalid-pch>)  # GCC 13 does not take at -O1 what was read at -O2: slower, not wrong
  endif()
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    get_source_file_property(options ${source} COMPILE_OPTIONS)
    if(options AND NOT options MATCHES "^[^;]*:-O[123]>$")
      set_source_files_properties(${source} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    endif()
  endforeach()
endfunction()

# Compiles sources of a target together, as few files (ESPALIER_FROM_SCRATCH): their headers are read and their templates
# made once. Sources with the same options go together, up to 200 kB (half a minute of a compiler), or, with LARGE, up to
# 700 kB where few cores have much memory each: such a piece takes a compiler 3.6 GB, and two thirds of the time of four.
# Eigen's expressions gain nothing from it. Names in their anonymous namespaces must differ; a clash is an error of the compiler.
# ESPALIER_APART names those whose sources somebody edits: they stay files of their own (-DESPALIER_APART="reading;building").
# VECTORS: each source is read once per instruction set by Highway; then all of them are, and they share its headers.
# espalier_together(target name [LARGE] [VECTORS] OPTIONS options... SOURCES files...), files relative to the current folder.
function(espalier_together target name)
  cmake_parse_arguments(ARG "LARGE;VECTORS" "" "OPTIONS;SOURCES" ${ARGN})
  set(limit 200000)
  if(ARG_LARGE AND cores LESS_EQUAL 4 AND memory_per_core GREATER 6000)
    set(limit 700000)
  endif()
  if(ARG_OPTIONS)
    set_property(SOURCE ${ARG_SOURCES} APPEND PROPERTY COMPILE_OPTIONS ${ARG_OPTIONS})
  endif()
  if(NOT ESPALIER_FROM_SCRATCH OR name IN_LIST ESPALIER_APART)
    return()
  endif()
  set(pieces)
  foreach(source IN LISTS ARG_SOURCES)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
    get_source_file_property(options ${source} COMPILE_OPTIONS)
    file(SIZE ${source} bytes)
    string(MD5 key "${options}")
    if(NOT DEFINED bytes_${key})
      set(bytes_${key} 0)
      set(piece_${key} 0)
    endif()
    math(EXPR bytes_${key} "${bytes_${key}} + ${bytes}")
    if(bytes_${key} GREATER ${limit} AND text_${key}_${piece_${key}})
      math(EXPR piece_${key} "${piece_${key}} + 1")
      set(bytes_${key} ${bytes})
    endif()
    set(piece ${key}_${piece_${key}})
    string(APPEND text_${piece} "#include \"${source}\"\n")
    set(options_${piece} "${options}")
    list(APPEND pieces ${piece})
  endforeach()
  list(REMOVE_DUPLICATES pieces)
  set(number "")
  foreach(piece IN LISTS pieces)
    set(together ${CMAKE_CURRENT_BINARY_DIR}/${target}_${name}${number}.cpp)
    if(ARG_VECTORS)
      set(again "#undef HWY_TARGET_INCLUDE\n#define HWY_TARGET_INCLUDE \"${together}\"\n")
      set(text_${piece} "#include \"base/vector_targets.hpp\"\n${again}#include \"hwy/foreach_target.h\"\n${text_${piece}}${again}")
      set_source_files_properties(${together} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    endif()
    file(CONFIGURE OUTPUT ${together} CONTENT "${text_${piece}}" @ONLY)
    if(options_${piece})
      set_source_files_properties(${together} PROPERTIES COMPILE_OPTIONS "${options_${piece}}")
    endif()
    target_sources(${target} PRIVATE ${together})
    math(EXPR number "0${number} + 1")
  endforeach()
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)  # takes the included sources for headers
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
  endif()
  set_source_files_properties(${ARG_SOURCES} PROPERTIES HEADER_FILE_ONLY ON)
  list(TRANSFORM ARG_SOURCES REPLACE ".*/" "" OUTPUT_VARIABLE names)
  set_property(TARGET ${target} APPEND PROPERTY ESPALIER_TOGETHER ${names})
endfunction()

# Two targets of a folder may share sources, but what one compiles together is compiled so alone: every such source of
# the other must be in one of its pieces, or it would be lost.
# espalier_check_together(target)
function(espalier_check_together target)
  get_target_property(sources ${target} SOURCES)
  get_target_property(together ${target} ESPALIER_TOGETHER)
  foreach(source IN LISTS sources)
    get_source_file_property(left_out ${source} HEADER_FILE_ONLY)
    cmake_path(GET source FILENAME name)
    if(left_out AND NOT name IN_LIST together)
      message(FATAL_ERROR "${target} would not compile ${source}")
    endif()
  endforeach()
endfunction()

# All sources of a target together, but for those with definitions of their own and those that say
# SKIP_UNITY_BUILD_INCLUSION.
# espalier_all_together(target sources...)
function(espalier_all_together target)
  set(plain)
  foreach(source IN LISTS ARGN)
    get_source_file_property(definitions ${source} COMPILE_DEFINITIONS)
    get_source_file_property(apart ${source} SKIP_UNITY_BUILD_INCLUSION)
    if(NOT definitions AND NOT apart)
      list(APPEND plain ${source})
    endif()
  endforeach()
  list(LENGTH plain length)
  if(length GREATER 1)
    espalier_together(${target} sources SOURCES ${plain})
  endif()
endfunction()

function(espalier_module name)
  cmake_parse_arguments(ARG "APART;COLD;WARM" "FOLDER" "SUBFOLDERS;GENERATED;DEPENDS;LIBRARIES;HOT" ${ARGN})
  if(NOT ARG_FOLDER)
    set(ARG_FOLDER ${name})
  endif()
  set(globs ${CMAKE_CURRENT_SOURCE_DIR}/${ARG_FOLDER}/*.cpp)
  foreach(sub IN LISTS ARG_SUBFOLDERS)
    list(APPEND globs ${CMAKE_CURRENT_SOURCE_DIR}/${ARG_FOLDER}/${sub}/*.cpp)
  endforeach()
  if(ARG_GENERATED)
    set(sources ${ARG_GENERATED})
  else()
    file(GLOB sources CONFIGURE_DEPENDS ${globs})
  endif()
  if(ARG_SUBFOLDERS)  # a folder that is forgotten would be missed by a build that compiles each source apart alone
    file(GLOB_RECURSE forgotten CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${ARG_FOLDER}/*.cpp)
    list(REMOVE_ITEM forgotten ${sources})
    list(FILTER forgotten EXCLUDE REGEX "/(cuda|embed)/")
    if(forgotten)
      message(FATAL_ERROR "espalier_module(${name}): SUBFOLDERS does not name the folders of ${forgotten}")
    endif()
  endif()
  if(NOT sources)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${name}_empty.cpp "")
    set(sources ${CMAKE_CURRENT_BINARY_DIR}/${name}_empty.cpp)
  endif()
  add_library(espalier_${name} STATIC ${sources})
  if(ARG_COLD)
    list(TRANSFORM ARG_HOT REPLACE "(.+)" "${CMAKE_CURRENT_SOURCE_DIR}/${ARG_FOLDER}/\\1.cpp")
    espalier_cold(espalier_${name} HOT ${ARG_HOT})
  endif()
  if(ARG_WARM)
    target_compile_options(espalier_${name} PRIVATE $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<CONFIG:Release>>:-O2>)
  endif()
  if(NOT ARG_APART)
    espalier_all_together(espalier_${name} ${sources})
  endif()
  if(NOT ARG_APART AND NOT name STREQUAL base)
    espalier_precompile(espalier_${name} FROM espalier_base)
  endif()
  set_target_properties(espalier_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  espalier_flags(espalier_${name})
  target_include_directories(espalier_${name} PUBLIC ${PROJECT_SOURCE_DIR}/src
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>)
  foreach(dependency IN LISTS ARG_DEPENDS)
    target_link_libraries(espalier_${name} PUBLIC espalier_${dependency})
  endforeach()
  target_link_libraries(espalier_${name} PUBLIC ${ARG_LIBRARIES})
  set_property(GLOBAL PROPERTY ESPALIER_LIBRARIES_OF_${name} ${ARG_LIBRARIES})
endfunction()

# espalier_combine(modules...): the library that is installed, espalier::espalier, made of the objects of these modules.
# Static unless BUILD_SHARED_LIBS is set. What the modules link stays private: public headers need the standard library
# alone.
function(espalier_combine)
  set(objects)
  set(libraries)
  foreach(module IN LISTS ARGN)
    list(APPEND objects $<TARGET_OBJECTS:espalier_${module}>)
    get_property(of_module GLOBAL PROPERTY ESPALIER_LIBRARIES_OF_${module})
    list(APPEND libraries ${of_module})
  endforeach()
  add_library(espalier_library ${objects})
  add_library(espalier::espalier ALIAS espalier_library)
  set_target_properties(espalier_library PROPERTIES OUTPUT_NAME espalier EXPORT_NAME espalier LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  target_compile_features(espalier_library INTERFACE cxx_std_20)
  target_include_directories(espalier_library INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  list(REMOVE_DUPLICATES libraries)
  target_link_libraries(espalier_library PRIVATE ${libraries})
  if(ESPALIER_SANITIZE)
    target_link_options(espalier_library PUBLIC $<BUILD_INTERFACE:-fsanitize=${ESPALIER_SANITIZE}>)
  endif()
endfunction()
