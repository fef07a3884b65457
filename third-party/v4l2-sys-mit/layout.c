// The layout that src/layout.rs states, for a C compiler and the system's header:
// cc -fsyntax-only third-party/v4l2-sys-mit/layout.c
#include <stddef.h>
#include <linux/videodev2.h>

#if __SIZEOF_POINTER__ == 8
_Static_assert(sizeof(struct v4l2_capability) == 104, "v4l2_capability");
_Static_assert(offsetof(struct v4l2_capability, card) == 16, "v4l2_capability.card");
_Static_assert(offsetof(struct v4l2_capability, bus_info) == 48, "v4l2_capability.bus_info");
_Static_assert(offsetof(struct v4l2_capability, version) == 80, "v4l2_capability.version");
_Static_assert(offsetof(struct v4l2_capability, capabilities) == 84, "v4l2_capability.capabilities");
_Static_assert(offsetof(struct v4l2_capability, device_caps) == 88, "v4l2_capability.device_caps");
_Static_assert(sizeof(struct v4l2_fmtdesc) == 64, "v4l2_fmtdesc");
_Static_assert(offsetof(struct v4l2_fmtdesc, flags) == 8, "v4l2_fmtdesc.flags");
_Static_assert(offsetof(struct v4l2_fmtdesc, description) == 12, "v4l2_fmtdesc.description");
_Static_assert(offsetof(struct v4l2_fmtdesc, pixelformat) == 44, "v4l2_fmtdesc.pixelformat");
_Static_assert(sizeof(struct v4l2_format) == 208, "v4l2_format");
_Static_assert(offsetof(struct v4l2_format, fmt) == 8, "v4l2_format.fmt");
_Static_assert(sizeof(struct v4l2_pix_format) == 48, "v4l2_pix_format");
_Static_assert(offsetof(struct v4l2_pix_format, height) == 4, "v4l2_pix_format.height");
_Static_assert(offsetof(struct v4l2_pix_format, pixelformat) == 8, "v4l2_pix_format.pixelformat");
_Static_assert(offsetof(struct v4l2_pix_format, field) == 12, "v4l2_pix_format.field");
_Static_assert(offsetof(struct v4l2_pix_format, bytesperline) == 16, "v4l2_pix_format.bytesperline");
_Static_assert(offsetof(struct v4l2_pix_format, sizeimage) == 20, "v4l2_pix_format.sizeimage");
_Static_assert(offsetof(struct v4l2_pix_format, colorspace) == 24, "v4l2_pix_format.colorspace");
_Static_assert(offsetof(struct v4l2_pix_format, flags) == 32, "v4l2_pix_format.flags");
_Static_assert(offsetof(struct v4l2_pix_format, quantization) == 40, "v4l2_pix_format.quantization");
_Static_assert(offsetof(struct v4l2_pix_format, xfer_func) == 44, "v4l2_pix_format.xfer_func");
_Static_assert(sizeof(struct v4l2_requestbuffers) == 20, "v4l2_requestbuffers");
_Static_assert(offsetof(struct v4l2_requestbuffers, type) == 4, "v4l2_requestbuffers.type");
_Static_assert(offsetof(struct v4l2_requestbuffers, memory) == 8, "v4l2_requestbuffers.memory");
_Static_assert(sizeof(struct v4l2_buffer) == 88, "v4l2_buffer");
_Static_assert(offsetof(struct v4l2_buffer, type) == 4, "v4l2_buffer.type");
_Static_assert(offsetof(struct v4l2_buffer, bytesused) == 8, "v4l2_buffer.bytesused");
_Static_assert(offsetof(struct v4l2_buffer, flags) == 12, "v4l2_buffer.flags");
_Static_assert(offsetof(struct v4l2_buffer, field) == 16, "v4l2_buffer.field");
_Static_assert(offsetof(struct v4l2_buffer, timestamp) == 24, "v4l2_buffer.timestamp");
_Static_assert(offsetof(struct v4l2_buffer, sequence) == 56, "v4l2_buffer.sequence");
_Static_assert(offsetof(struct v4l2_buffer, memory) == 60, "v4l2_buffer.memory");
_Static_assert(offsetof(struct v4l2_buffer, m) == 64, "v4l2_buffer.m");
_Static_assert(offsetof(struct v4l2_buffer, length) == 72, "v4l2_buffer.length");
_Static_assert(sizeof(struct timeval) == 16, "timeval");
_Static_assert(offsetof(struct timeval, tv_usec) == 8, "timeval.tv_usec");
_Static_assert(sizeof(struct v4l2_streamparm) == 204, "v4l2_streamparm");
_Static_assert(offsetof(struct v4l2_streamparm, parm) == 4, "v4l2_streamparm.parm");
_Static_assert(sizeof(struct v4l2_captureparm) == 40, "v4l2_captureparm");
_Static_assert(offsetof(struct v4l2_captureparm, timeperframe) == 8, "v4l2_captureparm.timeperframe");
_Static_assert(sizeof(struct v4l2_frmsizeenum) == 44, "v4l2_frmsizeenum");
_Static_assert(offsetof(struct v4l2_frmsizeenum, pixel_format) == 4, "v4l2_frmsizeenum.pixel_format");
_Static_assert(offsetof(struct v4l2_frmsizeenum, type) == 8, "v4l2_frmsizeenum.type");
_Static_assert(offsetof(struct v4l2_frmsizeenum, discrete) == 12, "v4l2_frmsizeenum.discrete");
_Static_assert(sizeof(struct v4l2_frmivalenum) == 52, "v4l2_frmivalenum");
_Static_assert(offsetof(struct v4l2_frmivalenum, width) == 8, "v4l2_frmivalenum.width");
_Static_assert(offsetof(struct v4l2_frmivalenum, type) == 16, "v4l2_frmivalenum.type");
_Static_assert(offsetof(struct v4l2_frmivalenum, discrete) == 20, "v4l2_frmivalenum.discrete");
_Static_assert(sizeof(struct v4l2_ext_control) == 20, "v4l2_ext_control");
_Static_assert(offsetof(struct v4l2_ext_control, size) == 4, "v4l2_ext_control.size");
_Static_assert(offsetof(struct v4l2_ext_control, value64) == 12, "v4l2_ext_control.value64");
_Static_assert(sizeof(struct v4l2_ext_controls) == 32, "v4l2_ext_controls");
_Static_assert(offsetof(struct v4l2_ext_controls, count) == 4, "v4l2_ext_controls.count");
_Static_assert(offsetof(struct v4l2_ext_controls, controls) == 24, "v4l2_ext_controls.controls");
_Static_assert(sizeof(struct v4l2_query_ext_ctrl) == 232, "v4l2_query_ext_ctrl");
_Static_assert(offsetof(struct v4l2_query_ext_ctrl, type) == 4, "v4l2_query_ext_ctrl.type");
_Static_assert(offsetof(struct v4l2_query_ext_ctrl, name) == 8, "v4l2_query_ext_ctrl.name");
_Static_assert(offsetof(struct v4l2_query_ext_ctrl, minimum) == 40, "v4l2_query_ext_ctrl.minimum");
_Static_assert(offsetof(struct v4l2_query_ext_ctrl, flags) == 72, "v4l2_query_ext_ctrl.flags");
#endif
