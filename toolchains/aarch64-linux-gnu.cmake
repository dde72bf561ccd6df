# Cross build for 64-bit Arm Linux (Debian's g++-aarch64-linux-gnu) against the sysroot of make_sysroot.sh. Where
# qemu-user-static is installed, ctest runs the tests in it.
# HAUSTRA_SYSROOT (CMake or environment) names the sysroot; default: build/sysroot-aarch64 in the source tree.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)

if(NOT HAUSTRA_SYSROOT)
  if(DEFINED ENV{HAUSTRA_SYSROOT})
    set(HAUSTRA_SYSROOT $ENV{HAUSTRA_SYSROOT})
  else()
    set(HAUSTRA_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-aarch64)
  endif()
endif()
get_filename_component(HAUSTRA_SYSROOT ${HAUSTRA_SYSROOT} ABSOLUTE)
# CMake reads this file again for the projects with which it tries the compiler.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES HAUSTRA_SYSROOT)
if(NOT EXISTS ${HAUSTRA_SYSROOT}/usr/lib/aarch64-linux-gnu)
  message(FATAL_ERROR "There is no aarch64 sysroot in ${HAUSTRA_SYSROOT}: run toolchains/make_sysroot.sh, or name another "
                      "one in HAUSTRA_SYSROOT")
endif()
set(CMAKE_SYSROOT ${HAUSTRA_SYSROOT})
set(CMAKE_FIND_ROOT_PATH ${HAUSTRA_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
# pkg-config must not find the libraries of the machine that builds.
set(ENV{PKG_CONFIG_LIBDIR} ${HAUSTRA_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${HAUSTRA_SYSROOT}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${HAUSTRA_SYSROOT})

# No -mcpu: one binary runs on every armv8-a; kernels/cpu/simd_level.h chooses newer instructions at run time.

find_program(HAUSTRA_QEMU_AARCH64 NAMES qemu-aarch64-static qemu-aarch64)
if(HAUSTRA_QEMU_AARCH64)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${HAUSTRA_QEMU_AARCH64};-cpu;max;-L;${HAUSTRA_SYSROOT}" CACHE STRING
      "Runs programs of the target on the machine that builds")
endif()
