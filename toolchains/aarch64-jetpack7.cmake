# Jetson Thor with JetPack 7: Ubuntu 24.04 (C library 2.39), CUDA 13, sm_110. HAUSTRA_SYSROOT names the board's root file
# system or a copy of it (/lib, /usr/include, /usr/lib, /usr/local/cuda), with the packages that README.md beside this file
# lists; default: build/sysroot-jetpack7 in the source tree.
if(NOT HAUSTRA_SYSROOT AND NOT DEFINED ENV{HAUSTRA_SYSROOT})
  set(HAUSTRA_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-jetpack7)
endif()
include(${CMAKE_CURRENT_LIST_DIR}/aarch64-linux-gnu.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/jetpack-cuda.cmake)
