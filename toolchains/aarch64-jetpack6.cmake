# Jetson Orin with JetPack 6: Ubuntu 22.04 (C library 2.35), CUDA 12.6, sm_87. HAUSTRA_SYSROOT names the board's root file
# system or a copy of it (/lib, /usr/include, /usr/lib, /usr/local/cuda), with the packages that README.md beside this file
# lists; default: build/sysroot-jetpack6 in the source tree.
if(NOT HAUSTRA_SYSROOT AND NOT DEFINED ENV{HAUSTRA_SYSROOT})
  set(HAUSTRA_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-jetpack6)
endif()
include(${CMAKE_CURRENT_LIST_DIR}/aarch64-linux-gnu.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/jetpack-cuda.cmake)
