# Installation: the library with its headers, the CMake package, the pkg-config file, the binary, and the relocatable
# bundle (target `bundle`).
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/espalier)
install(TARGETS espalier_library EXPORT espalier
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/espalier DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT espalier NAMESPACE espalier:: FILE espalierTargets.cmake DESTINATION ${package_dir})
configure_package_config_file(cmake/espalierConfig.cmake.in ${PROJECT_BINARY_DIR}/espalierConfig.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/espalierConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES $<TARGET_FILE_DIR:espalier_library>/espalier.origin DESTINATION ${package_dir} OPTIONAL)
install(FILES ${PROJECT_BINARY_DIR}/espalierConfig.cmake ${PROJECT_BINARY_DIR}/espalierConfigVersion.cmake cmake/FindHWY.cmake
  DESTINATION ${package_dir})

# pkg-config: a static library needs what it was built with on every link line, a shared one does not.
set(requirements "fmt zlib pugixml")
set(link_line "-lhwy -lstdc++ -lm -pthread")
if(BUILD_SHARED_LIBS)
  set(PC_REQUIRES_PRIVATE "${requirements}")
  set(PC_LIBS_PRIVATE "${link_line}")
else()
  set(PC_REQUIRES "${requirements}")
  set(PC_LIBS "${link_line}")
endif()
file(RELATIVE_PATH PC_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
configure_file(cmake/espalier.pc.in ${PROJECT_BINARY_DIR}/espalier.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/espalier.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

# The bundle: binary, the shared libraries that a bare machine lacks (all but those of glibc and of GCC's runtime) and
# the licences; in libexec/espalier what `espalier bench` starts, and the programs that bin/espalier-evidence runs
# (docs/decisions/002-the-bundle.md). CHOLMOD's supernodal part (GPL) and MUMPS (CeCILL-C) may not be linked into
# anything that is passed on. All find the libraries through an $ORIGIN rpath, wherever the folder is put.
install(TARGETS espalier_cli RUNTIME DESTINATION bin COMPONENT bundle EXCLUDE_FROM_ALL)
install(PROGRAMS scripts/evidence.sh RENAME espalier-evidence DESTINATION bin COMPONENT bundle EXCLUDE_FROM_ALL)
set(bundled "")
foreach(part espalier_rival_host rival_espalier rival_pardiso rival_cudss rival_eigen espalier_gpu_check
    espalier_memory_curve espalier_collection espalier_pivot_check test_device test_out_of_core test_solver)
  if(NOT TARGET ${part})
    continue()
  endif()
  list(APPEND bundled ${part})
  set_target_properties(${part} PROPERTIES INSTALL_RPATH "$ORIGIN/../../lib/espalier")
  target_link_options(${part} PRIVATE -Wl,--disable-new-dtags)
  install(TARGETS ${part}
    RUNTIME DESTINATION libexec/espalier COMPONENT bundle EXCLUDE_FROM_ALL
    LIBRARY DESTINATION libexec/espalier COMPONENT bundle EXCLUDE_FROM_ALL)
endforeach()
set(binaries "$<TARGET_FILE:espalier_cli>")
foreach(part IN LISTS bundled)
  list(APPEND binaries "$<TARGET_FILE:${part}>")
endforeach()
install(CODE "set(binaries \"${binaries}\")" COMPONENT bundle EXCLUDE_FROM_ALL)
install(SCRIPT cmake/bundle_libraries.cmake COMPONENT bundle EXCLUDE_FROM_ALL)
install(FILES ${ESPALIER_MODELS} DESTINATION share/espalier/models)
install(FILES ${ESPALIER_MODELS} DESTINATION share/espalier/models COMPONENT bundle EXCLUDE_FROM_ALL)
install(DIRECTORY models/real DESTINATION share/espalier/models COMPONENT bundle EXCLUDE_FROM_ALL FILES_MATCHING PATTERN "*.toml")
install(FILES LICENSE README.md CHANGELOG.md DESTINATION . COMPONENT bundle EXCLUDE_FROM_ALL)

set(CPACK_GENERATOR TGZ)
set(CPACK_PACKAGE_NAME espalier)
set(CPACK_PACKAGE_VENDOR Espalier)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_PACKAGE_FILE_NAME espalier-${PROJECT_VERSION}-linux-${CMAKE_SYSTEM_PROCESSOR})
set(CPACK_INSTALL_CMAKE_PROJECTS "${PROJECT_BINARY_DIR};espalier;bundle;/")
set(CPACK_STRIP_FILES ON)
set(CPACK_OUTPUT_CONFIG_FILE ${PROJECT_BINARY_DIR}/CPackBundle.cmake)
include(CPack)
add_custom_target(bundle COMMAND ${CMAKE_CPACK_COMMAND} --config ${PROJECT_BINARY_DIR}/CPackBundle.cmake
  -B ${PROJECT_BINARY_DIR} DEPENDS espalier_cli ${bundled} USES_TERMINAL
  COMMENT "Packing ${CPACK_PACKAGE_FILE_NAME}.tar.gz")
