/* A Modbus server by libmodbus, on TCP or, given a serial device, RTU: 65 536 holding registers with their own address in them, and as many coils and
 * discrete inputs: a coil is on where its address divides by 3 or by 7, a discrete input where by 5.
 *
 * On TCP it prints its port, then serves one client after another until standard input closes. On a serial line it
 * prints the device, and serves unit 1 until it is ended.
 */
#include <errno.h>
#include <modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static int serve_line(modbus_t *ctx, modbus_mapping_t *map, const char *device)
{
    uint8_t query[MODBUS_RTU_MAX_ADU_LENGTH];

    if (modbus_set_slave(ctx, 1) < 0 || modbus_connect(ctx) < 0) {
        fprintf(stderr, "%s: %s\n", device, modbus_strerror(errno));
        return 1;
    }
    printf("%s\n", device);
    fflush(stdout);
    for (;;) {
        int length = modbus_receive(ctx, query);
        if (length > 0)
            modbus_reply(ctx, query, length, map);
    }
}

int main(int count, char **arguments)
{
    modbus_t *ctx = count > 1 ? modbus_new_rtu(arguments[1], 115200, 'N', 8, 2) : modbus_new_tcp("127.0.0.1", 0);
    modbus_mapping_t *map = modbus_mapping_new(65536, 65536, 65536, 65536);
    struct sockaddr_in address;
    socklen_t size = sizeof address;
    uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
    int listening, i;

    if (ctx == NULL || map == NULL)
        return 1;
    for (i = 0; i < 65536; i++) {
        map->tab_registers[i] = (uint16_t) i;
        map->tab_input_registers[i] = (uint16_t) (65535 - i);
        map->tab_bits[i] = i % 3 == 0 || i % 7 == 0;
        map->tab_input_bits[i] = i % 5 == 0;
    }
    if (count > 1)
        return serve_line(ctx, map, arguments[1]);
    listening = modbus_tcp_listen(ctx, 4);
    if (listening < 0 || getsockname(listening, (struct sockaddr *) &address, &size) < 0) {
        fprintf(stderr, "listen: %s\n", modbus_strerror(errno));
        return 1;
    }
    printf("%d\n", ntohs(address.sin_port));
    fflush(stdout);
    for (;;) {
        struct pollfd wait[2] = {{listening, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
        if (poll(wait, 2, -1) < 0 || wait[1].revents)
            break;
        if (modbus_tcp_accept(ctx, &listening) < 0)
            break;
        for (;;) {
            int length = modbus_receive(ctx, query);
            if (length > 0)
                modbus_reply(ctx, query, length, map);
            else if (length < 0)
                break;
        }
        modbus_close(ctx);
    }
    modbus_mapping_free(map);
    modbus_free(ctx);
    return 0;
}
