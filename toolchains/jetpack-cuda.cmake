# CUDA for a Jetson, included by the toolchain files of the JetPacks after aarch64-linux-gnu.cmake.
#
# The compiler is this machine's (CUDACXX, or /usr/local/cuda/bin/nvcc), best of the JetPack's own version. Headers and
# libraries of the board come from the sysroot, where JetPack's packages put them (/usr/local/cuda), else from the cross
# packages of this machine's toolkit (cuda-cross-aarch64).
set(CMAKE_CUDA_HOST_COMPILER ${CMAKE_CXX_COMPILER})
if(DEFINED ENV{CUDACXX})
  get_filename_component(jetpack_cuda $ENV{CUDACXX} DIRECTORY)
  get_filename_component(jetpack_cuda ${jetpack_cuda} DIRECTORY)
else()
  set(jetpack_cuda /usr/local/cuda)
endif()
set(HAUSTRA_CUDA_TARGET "")
foreach(root ${HAUSTRA_SYSROOT}/usr/local/cuda ${jetpack_cuda})
  foreach(target aarch64-linux sbsa-linux)
    if(NOT HAUSTRA_CUDA_TARGET AND EXISTS ${root}/targets/${target}/lib/libcudart_static.a)
      set(HAUSTRA_CUDA_TARGET ${root}/targets/${target})
    endif()
  endforeach()
endforeach()
if(NOT HAUSTRA_CUDA_TARGET)
  message(FATAL_ERROR "There is no CUDA runtime for the board: neither in ${HAUSTRA_SYSROOT}/usr/local/cuda (a JetPack root "
                      "file system with nvidia-jetpack installed) nor in ${jetpack_cuda}/targets (cuda-cross-aarch64)")
endif()
# nvcc of another target than its own looks for them where it is told; CMake asks it where it looks.
set(CMAKE_CUDA_FLAGS_INIT "-I${HAUSTRA_CUDA_TARGET}/include -L${HAUSTRA_CUDA_TARGET}/lib")
list(APPEND CMAKE_FIND_ROOT_PATH ${HAUSTRA_CUDA_TARGET})
