# MUMPS in double precision, real and complex, sequential build, for bench/ only.
find_path(MUMPS_INCLUDE_DIR zmumps_c.h)
find_library(MUMPS_LIBRARY dmumps_seq)
find_library(MUMPS_COMPLEX_LIBRARY zmumps_seq)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(MUMPS REQUIRED_VARS MUMPS_LIBRARY MUMPS_COMPLEX_LIBRARY MUMPS_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "install libmumps-seq-dev")
if(MUMPS_FOUND AND NOT TARGET MUMPS::MUMPS)
  add_library(MUMPS::MUMPS UNKNOWN IMPORTED)
  set_target_properties(MUMPS::MUMPS PROPERTIES IMPORTED_LOCATION ${MUMPS_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${MUMPS_INCLUDE_DIR})
  add_library(MUMPS::COMPLEX UNKNOWN IMPORTED)
  set_target_properties(MUMPS::COMPLEX PROPERTIES IMPORTED_LOCATION ${MUMPS_COMPLEX_LIBRARY}
    INTERFACE_LINK_LIBRARIES MUMPS::MUMPS)
endif()
