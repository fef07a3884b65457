/* Sets a control of a V4L2 device by its name: control DEVICE NAME VALUE. For vivid's faults. */
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

int main(int argc, char **argv) {
    if (argc != 4) return fprintf(stderr, "usage: control DEVICE NAME VALUE\n"), 2;
    int device = open(argv[1], O_RDWR);
    if (device < 0) return perror(argv[1]), 2;
    struct v4l2_query_ext_ctrl query = {.id = V4L2_CTRL_FLAG_NEXT_CTRL};
    while (ioctl(device, VIDIOC_QUERY_EXT_CTRL, &query) == 0) {
        if (strcmp(query.name, argv[2]) == 0) {
            struct v4l2_ext_control control = {.id = query.id, .value = atoi(argv[3])};
            struct v4l2_ext_controls controls = {.count = 1, .controls = &control};
            if (ioctl(device, VIDIOC_S_EXT_CTRLS, &controls)) return perror(argv[2]), 2;
            return printf("set %s to %s\n", argv[2], argv[3]), 0;
        }
        query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return fprintf(stderr, "no control %s\n", argv[2]), 2;
}
