# Runs at installation, after the programs: copies the shared libraries that they need, and writes the licences and lists.
# Set by CMakeLists.txt: program_files (in the build folder), objdump, sysroot and triplet (cross build, else empty),
# python, packaging (this folder), project_version, cuda_version.
set(prefix "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}")
if(NOT python)
  message(FATAL_ERROR "python3 was not found when the build was configured: the bundle's licences are collected with it")
endif()

set(CMAKE_GET_RUNTIME_DEPENDENCIES_PLATFORM linux+elf)
set(CMAKE_GET_RUNTIME_DEPENDENCIES_TOOL objdump)
set(CMAKE_GET_RUNTIME_DEPENDENCIES_COMMAND "${objdump}")
set(folders)
if(sysroot)
  set(folders DIRECTORIES ${sysroot}/usr/lib/${triplet} ${sysroot}/lib/${triplet})
endif()
file(GET_RUNTIME_DEPENDENCIES
  EXECUTABLES ${program_files}
  RESOLVED_DEPENDENCIES_VAR libraries
  UNRESOLVED_DEPENDENCIES_VAR missing
  # The C library and its loader belong to the machine, the driver to its GPU.
  PRE_EXCLUDE_REGEXES "^ld-linux" "^lib(c|m|mvec|dl|rt|pthread|resolv|util|anl|nsl|nss_.*)\\.so" "^lib(cuda|nv.*)\\.so"
  ${folders}
)
if(missing)
  message(FATAL_ERROR "shared libraries that were not found: ${missing}")
endif()
list(SORT libraries)
file(MAKE_DIRECTORY ${prefix}/lib)
foreach(library IN LISTS libraries)
  get_filename_component(name ${library} NAME)
  file(REAL_PATH ${library} file)
  file(COPY_FILE ${file} ${prefix}/lib/${name} ONLY_IF_DIFFERENT)
  file(CHMOD ${prefix}/lib/${name} PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
  # A search path of its own would replace that of the program; some point at folders of the distribution.
  file(RPATH_REMOVE FILE ${prefix}/lib/${name})
endforeach()
list(LENGTH libraries num_bundled)
message(STATUS "Bundled ${num_bundled} shared libraries")

execute_process(
  COMMAND ${python} ${packaging}/papers.py --prefix ${prefix} --version ${project_version}
          "--cuda=${cuda_version}" "--sysroot=${sysroot}" --libraries ${libraries}
  RESULT_VARIABLE result
)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the bundle's licences could not be collected; the message stands above")
endif()
