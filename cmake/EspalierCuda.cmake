# espalier_add_cuda(module folder): adds the *.cu below src/<folder> to the module where ESPALIER_CUDA is on; else its stubs
# stand in. The runtime is linked statically, so the same binary works where there is no driver.
function(espalier_add_cuda module folder)
  file(GLOB_RECURSE hosted CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cpp)
  set_source_files_properties(${hosted} PROPERTIES COMPILE_DEFINITIONS ESPALIER_WITH_CUDA=$<BOOL:${ESPALIER_CUDA}>)
  if(NOT ESPALIER_CUDA)
    return()
  endif()
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cu)
  target_sources(espalier_${module} PRIVATE ${sources})
  # CMake 3.25 does not know that nvcc 13 speaks C++20.
  target_compile_options(espalier_${module} PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:-std=c++20 -lineinfo>)
  set_target_properties(espalier_${module} PROPERTIES CUDA_RUNTIME_LIBRARY Static)
  target_link_libraries(espalier_${module} PUBLIC CUDA::cudart_static)
  set_property(GLOBAL APPEND PROPERTY ESPALIER_EXTERNAL_LIBRARIES CUDA::cudart_static)
endfunction()
