# espalier_backend(folder NAME name IF variable ABSENT sentence SUBFOLDERS ... DEPENDS modules... LIBRARIES ...)
# The module device_<folder> of src/device/<folder>, and an entry in the registry: the folder defines
# `const Backend& espalier::device::<folder>::backend()`. NAME: as Options::device calls it (by default the folder's name).
# IF: a variable; where it is off, nothing is built, and a user who asks for the name reads ABSENT. CUDA sources (*.cu) are
# compiled where the folder has them. APART, COLD, HOT: as for espalier_module().
function(espalier_backend folder)
  cmake_parse_arguments(ARG "APART;COLD" "NAME;IF;ABSENT" "SUBFOLDERS;DEPENDS;LIBRARIES;HOT" ${ARGN})
  if(NOT ARG_NAME)
    set(ARG_NAME ${folder})
  endif()
  if(ARG_IF AND NOT ${ARG_IF})
    set_property(GLOBAL APPEND_STRING PROPERTY ESPALIER_BACKENDS_ABSENT "    {\"${ARG_NAME}\", \"${ARG_ABSENT}\"},\n")
    return()
  endif()
  set(flags)
  foreach(flag APART COLD)
    if(ARG_${flag})
      list(APPEND flags ${flag})
    endif()
  endforeach()
  espalier_module(device_${folder} ${flags} HOT ${ARG_HOT} FOLDER device/${folder} SUBFOLDERS ${ARG_SUBFOLDERS} DEPENDS out_of_core ${ARG_DEPENDS}
    LIBRARIES ${ARG_LIBRARIES})
  espalier_cuda_sources(device_${folder} device/${folder})
  set_property(GLOBAL APPEND PROPERTY ESPALIER_BACKENDS ${folder})
  if(NOT ARG_IF)
    set_property(GLOBAL APPEND PROPERTY ESPALIER_BACKENDS_ANYWHERE ${folder})
  endif()
  set_property(GLOBAL APPEND PROPERTY ESPALIER_BACKEND_MODULES ${ARG_DEPENDS} device_${folder})
endfunction()

# The *.cu below a folder. The runtime is linked statically, so that the same binary works where there is no driver.
function(espalier_cuda_sources module folder)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cu)
  if(NOT sources)
    return()
  endif()
  target_sources(espalier_${module} PRIVATE ${sources})
  # CMake 3.25 does not know that nvcc 13 speaks C++20.
  target_compile_options(espalier_${module} PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:-std=c++20 -lineinfo>)
  set_target_properties(espalier_${module} PROPERTIES CUDA_RUNTIME_LIBRARY Static)
  target_link_libraries(espalier_${module} PUBLIC CUDA::cudart_static)
  set_property(GLOBAL APPEND PROPERTY ESPALIER_EXTERNAL_LIBRARIES CUDA::cudart_static)
endfunction()

# espalier_write_registry(file absent folders...): the source of a registry (device/registry.hpp) of these backends.
# absent: lines {"name", "sentence"},
function(espalier_write_registry file absent)
  set(declared "")
  set(listed "")
  foreach(folder IN LISTS ARGN)
    string(APPEND declared "namespace ${folder} {\nconst Backend& backend();\n}\n")
    string(APPEND listed "    &${folder}::backend(),\n")
  endforeach()
  file(CONFIGURE OUTPUT ${file} @ONLY CONTENT [[
// Written by CMake (cmake/EspalierBackend.cmake).
#include "device/registry.hpp"

namespace espalier::device {

@declared@
const Registry& registry() {
  static const Registry the_registry{{
@listed@  }, {
@absent@  }};
  return the_registry;
}

}  // namespace espalier::device
]])
endfunction()

# espalier_backend_registry(module): the registry of all backends named before as a module.
# Sets ESPALIER_BACKEND_MODULES to what they are made of.
function(espalier_backend_registry module)
  get_property(folders GLOBAL PROPERTY ESPALIER_BACKENDS)
  get_property(absent GLOBAL PROPERTY ESPALIER_BACKENDS_ABSENT)
  get_property(modules GLOBAL PROPERTY ESPALIER_BACKEND_MODULES)
  list(TRANSFORM folders PREPEND device_ OUTPUT_VARIABLE libraries)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${module}/registry.cpp)
  espalier_write_registry(${generated} "${absent}" ${folders})
  espalier_module(${module} GENERATED ${generated} DEPENDS ${libraries})
  set(ESPALIER_BACKEND_MODULES ${modules} PARENT_SCOPE)
endfunction()
