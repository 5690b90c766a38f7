def refuse_faults(network):
    pass
