/* A Modbus server on libmodbus, for tests: code that neither client nor emulator has any part in.
 *
 *   modbus_peer tcp            prints the port it listens on, on 127.0.0.1
 *   modbus_peer rtu DEVICE     prints 0, serves unit 7 on a serial line
 *
 * Holding registers 0 to 99 keep what is written; input registers 0 to 9 hold 1000 + their address.
 */
#include <modbus.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

int main(int argc, char **argv)
{
    modbus_mapping_t *map = modbus_mapping_new(0, 0, 100, 10);
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    modbus_t *server;
    int listening, i;

    for (i = 0; i < 10; i++)
        map->tab_input_registers[i] = 1000 + i;
    if (argc > 2 && !strcmp(argv[1], "rtu")) {
        server = modbus_new_rtu(argv[2], 115200, 'N', 8, 1);
        modbus_set_slave(server, 7);
        if (modbus_connect(server))
            return 1;
        printf("0\n");
    } else {
        struct sockaddr_in address;
        socklen_t size = sizeof address;
        server = modbus_new_tcp("127.0.0.1", 0);
        listening = modbus_tcp_listen(server, 1);
        if (listening < 0 || getsockname(listening, (struct sockaddr *)&address, &size))
            return 1;
        printf("%d\n", ntohs(address.sin_port));
        fflush(stdout);
        modbus_tcp_accept(server, &listening);
    }
    fflush(stdout);
    for (;;) {
        int length = modbus_receive(server, query);
        if (length > 0)
            modbus_reply(server, query, length, map);
        else if (length < 0 && argc < 3)
            return 0;
    }
}
